// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cctype>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <catch2/catch.hpp>

#include "tests/support/paths.hpp"

namespace wrenchd::test_citations {

// Checks the citations of the tree: METHOD (22) and sections of core/METHOD.md, Eq. (8) and sections of the
// paper, names of Markdown files, links of the guides.

namespace {

namespace fs = std::filesystem;

const fs::path kSource = wrenchd::test::source_path();
constexpr const char* kThisFile = "tests/core/test_citations.cpp";

std::string read(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::string name_of(const fs::path& file) {
  return fs::relative(file, kSource).generic_string();
}

/// Returns the text files of the tree without generated files.
std::vector<fs::path> sources() {
  static const std::set<std::string> kinds = {".hpp", ".cpp", ".in",   ".md",  ".toml", ".py", ".txt",
                                              ".mjs", ".js",  ".html", ".css", ".gp",   ""};
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(kSource))
    if (entry.path().extension() == ".md") files.push_back(entry.path());
  for (const char* room : {"core", "devices", "collision", "config", "daemon", "tests", "tools"})
    for (const auto& entry : fs::recursive_directory_iterator(kSource / room)) {
      const bool data = name_of(entry.path()).starts_with("tests/data/");
      if (entry.is_regular_file() && !data && kinds.contains(entry.path().extension().string()))
        files.push_back(entry.path());
    }
  std::sort(files.begin(), files.end());
  return files;
}

/// Returns a text as one line, without comment marks and without the quotes between parts of a string
/// literal. So a citation may continue on the next line.
class Text {
 public:
  explicit Text(std::string_view text) {
    static constexpr std::string_view marks = " \t/#*|<!\"";
    int line = 1;
    for (std::size_t i = 0; i < text.size(); ++i) {
      char c = text[i];
      if (c == '\n') {
        ++line;
        if (joined_.ends_with('"')) remove_last();
        while (i + 1 < text.size() && marks.find(text[i + 1]) != std::string_view::npos) ++i;
        c = ' ';
      }
      if (c == ' ' && joined_.ends_with(' ')) continue;
      joined_ += c;
      line_.push_back(line);
    }
  }
  const std::string& joined() const { return joined_; }
  int line(std::size_t at) const { return line_[at]; }

 private:
  void remove_last() {
    joined_.pop_back();
    line_.pop_back();
  }

  std::string joined_;
  std::vector<int> line_;
};

/// The lines of a Markdown file: those of fenced blocks and the others.
struct Markdown {
  std::vector<std::string> fenced, prose;

  explicit Markdown(const std::string& text) {
    bool inside = false;
    for (std::size_t begin = 0; begin < text.size();) {
      const std::size_t end = std::min(text.find('\n', begin), text.size());
      const std::string line = text.substr(begin, end - begin);
      begin = end + 1;
      if (line.starts_with("```"))
        inside = !inside;
      else
        (inside ? fenced : prose).push_back(line);
    }
  }
};

using Numbers = std::set<std::string>;

/// Content of core/METHOD.md: its sections, its equations, and the equations of the paper that it lists.
struct Method {
  Numbers sections, equations, of_paper;
  std::vector<std::string> in_order;  ///< equations

  Method() {
    const Markdown text(read(kSource / "core/METHOD.md"));
    static const std::regex heading(R"(^#+ (\d+(?:\.\d+)?) .+)"), equation(R"(.*\s\((\d+[a-z]?)\)$)"),
        row(R"(^\| (\(\d+\)(?:, \(\d+\))*) \|.*)"), number(R"(\((\d+)\))");
    std::smatch match;
    for (const std::string& line : text.fenced)
      if (std::regex_match(line, match, equation)) {
        equations.insert(match[1]);
        in_order.push_back(match[1]);
      }
    for (const std::string& line : text.prose) {
      if (std::regex_match(line, match, heading)) sections.insert(match[1]);
      if (!std::regex_match(line, match, row)) continue;
      const std::string cell = match[1];
      for (std::sregex_iterator i(cell.begin(), cell.end(), number), end; i != end; ++i)
        of_paper.insert((*i)[1]);
    }
  }
};

const Method& method() {
  static const Method method;
  return method;
}

/// A list of numbers, "(24)-(26)", "3.2 to 3.4, 5 and 6", with what lies between the ends of a range of
/// equations.
std::vector<std::string> numbers_in(const std::string& list) {
  static const std::regex item(R"((,? and |, | to |-)?\(?(\d+(?:\.\d+)*[a-z]?)\)?)");
  std::vector<std::string> numbers;
  for (std::sregex_iterator i(list.begin(), list.end(), item), end; i != end; ++i) {
    const std::string before = (*i)[1], number = (*i)[2];
    const bool range =
        (before == " to " || before == "-") && !numbers.empty() && number.find('.') == std::string::npos;
    if (range && numbers.back().find('.') == std::string::npos)
      for (int n = std::stoi(numbers.back()) + 1; n < std::stoi(number); ++n)
        numbers.push_back(std::to_string(n));
    numbers.push_back(number);
  }
  return numbers;
}

/// Checks the citations of one text.
class CitationCheck {
 public:
  /// in_method: the text is core/METHOD.md, which cites its own sections without the file name.
  explicit CitationCheck(const std::string& text, bool in_method = false)
      : text_(text), in_method_(in_method) {
    each("METHOD (", &CitationCheck::check_method_equation);
    each("Eq. ", &CitationCheck::check_paper_equation);
    each("Eqs. ", &CitationCheck::check_paper_equation);
    each("section", &CitationCheck::check_section);
    each("Section", &CitationCheck::check_section);
  }
  const std::vector<std::string>& errors() const { return errors_; }

 private:
  static constexpr std::size_t kLongestCitation = 200;

  void each(std::string_view word, void (CitationCheck::*check)(std::size_t)) {
    const std::string& t = text_.joined();
    for (std::size_t at = t.find(word); at != std::string::npos; at = t.find(word, at + 1))
      (this->*check)(at);
  }
  void report(std::size_t at, const std::string& message) {
    errors_.push_back(std::to_string(text_.line(at)) + ": " + message);
  }
  /// The first group of a pattern that matches from this position on; empty if it does not match.
  std::string match_at(std::size_t at, const std::regex& pattern) const {
    const std::string part = text_.joined().substr(at, kLongestCitation);
    std::smatch match;
    const bool found = std::regex_search(part, match, pattern, std::regex_constants::match_continuous);
    return found ? match[1].str() : std::string();
  }
  bool preceded_by(std::size_t at, const char* pattern) const {
    const std::size_t length = std::min<std::size_t>(at, 24);
    return std::regex_match(text_.joined().substr(at - length, length),
                            std::regex(std::string(R"([\s\S]*)") + pattern));
  }

  void check_method_equation(std::size_t at) {
    static const std::regex citation("METHOD (" + kEquations + ")");
    for (const std::string& n : numbers_in(match_at(at, citation)))
      if (!method().equations.contains(n)) report(at, "METHOD (" + n + ") does not exist");
  }

  void check_paper_equation(std::size_t at) {
    static const std::regex citation(R"(Eqs?\. ()" + kEquations + ")");
    const bool other_work = preceded_by(at, R"(\d{4}, )");  // (Author 2018, Eqs. 1, 2)
    if (other_work || preceded_by(at, R"(\w)")) return;
    const std::vector<std::string> numbers = numbers_in(match_at(at, citation));
    if (numbers.empty()) report(at, "write Eq. (8) for an equation of the paper");
    for (const std::string& n : numbers)
      if (!method().of_paper.contains(n))
        report(at, "core/METHOD.md, section 18, does not list Eq. (" + n + ")");
  }

  void check_section(std::size_t at) {
    static const std::regex citation(R"([Ss]ections? (\d+(?:\.\d+)*(?:(?:,? and |, | to )\d+(?:\.\d+)*)*))");
    const std::vector<std::string> numbers = numbers_in(match_at(at, citation));
    const bool of_standard = preceded_by(at, R"((?:HID 1\.11|USB 2\.0),? )");
    if (numbers.empty() || of_standard) return;
    const bool of_paper = preceded_by(at, "paper, "), of_method = preceded_by(at, R"(METHOD\.md\)?, )");
    for (const std::string& n : numbers) {
      if (std::count(n.begin(), n.end(), '.') > 1) continue;  // a section of a standard
      if (of_paper && !kPaperSections.contains(n)) report(at, "the paper has no section " + n);
      if (of_paper) continue;
      if (!of_method && !in_method_)
        report(at, "section " + n + " of which document? Write paper, section " + n +
                       " or core/METHOD.md, section " + n);
      else if (!method().sections.contains(n))
        report(at, "core/METHOD.md has no section " + n);
    }
  }

  inline static const std::string kEquations = R"((?:\(\d+[a-z]?\)(?:(?:,? and |, | to |-)(?=\())?)+)";
  inline static const Numbers kPaperSections = {"1",   "1.1", "2",   "2.1", "2.2", "2.3", "2.4", "3", "3.1",
                                                "3.2", "3.3", "3.4", "3.5", "4",   "4.1", "4.2", "5", "6"};

  Text text_;
  bool in_method_;
  std::vector<std::string> errors_;
};

/// "line: message" for each wrong citation of a text. in_method: as in CitationCheck.
std::vector<std::string> citation_errors(const std::string& text, bool in_method = false) {
  return CitationCheck(text, in_method).errors();
}

/// The names of Markdown files in a text, without a leading slash.
std::vector<std::string> markdown_names_in(std::string_view text) {
  constexpr std::string_view kEnd = ".md";
  const auto is_word = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; };
  std::vector<std::string> names;
  for (std::size_t at = text.find(kEnd); at != std::string_view::npos; at = text.find(kEnd, at + 1)) {
    const std::size_t end = at + kEnd.size();
    if (at == 0 || !is_word(text[at - 1]) || (end < text.size() && is_word(text[end]))) continue;
    std::size_t begin = at;
    while (begin > 0 && (is_word(text[begin - 1]) ||
                         std::string_view("./-").find(text[begin - 1]) != std::string_view::npos))
      --begin;
    if (text[begin] == '/') ++begin;
    names.emplace_back(text.substr(begin, end - begin));
  }
  return names;
}

/// The anchor of a heading, as GitHub makes it.
std::string slug(const std::string& heading) {
  std::string out;
  for (const char c : heading) {
    const auto u = static_cast<unsigned char>(c);
    if (c == ' ')
      out += '-';
    else if (std::isalnum(u) || c == '-' || c == '_' || u >= 0x80)
      out += static_cast<char>(std::tolower(u));
  }
  return out;
}

std::set<std::string> anchors_of(const fs::path& file) {
  std::set<std::string> anchors;
  for (const std::string& line : Markdown(read(file)).prose) {
    const std::size_t level = line.find_first_not_of('#');
    if (level == 0 || level == std::string::npos || line[level] != ' ') continue;
    anchors.insert(slug(line.substr(level + 1)));
  }
  return anchors;
}

}  // namespace

TEST_CASE("every citation of the method and of the paper has a target", "[citations]") {
  REQUIRE(sources().size() > 300);
  for (const fs::path& file : sources()) {
    const std::string name = name_of(file);
    if (name == kThisFile) continue;  // it contains wrong citations
    for (const std::string& error : citation_errors(read(file), name == "core/METHOD.md"))
      FAIL_CHECK(name << ':' << error);
  }
}

TEST_CASE("valid citations pass, invalid citations are reported", "[citations]") {
  for (const char* right :
       {"METHOD (22), core/METHOD.md, section 3.4, Eqs. (26)-(30) and paper, sections 3.2 to 3.4",
        "/// METHOD (24)-(26), METHOD (9), Eq. (8), core/METHOD.md,\n/// section 5",
        "core/METHOD.md, sections 10 and 11", "HID 1.11 section 6.2.2, USB 2.0, section 9.4",
        "section 6.2.2.4 to 6.2.2.8", "(Sola 2018, Eqs. 143, 144)",
        "[core/METHOD.md](../core/METHOD.md), section 14",
        "\"of Eqs. \"\n  \"(43) and \"\n  \"(46) as\\n\""}) {
    INFO(right);
    CHECK(citation_errors(right).empty());
  }
  for (const char* wrong :
       {"METHOD (999)", "METHOD (9), (999)", "METHOD (95)-(199)", "core/METHOD.md, section 99",
        "core/METHOD.md, section 3.99", "see core/METHOD.md,\n/// section 99", "section 3 of the method",
        "(section 2.4)", "paper, section 7", "(Eq. 8)", "Eq. (99)", "Eqs. (53)-(55)"}) {
    INFO(wrong);
    CHECK_FALSE(citation_errors(wrong).empty());
  }
}

TEST_CASE("the equation numbers of the method are unique and ascending", "[citations]") {
  CHECK(method().sections.size() > 50);
  const auto less = [](const std::string& a, const std::string& b) {
    return std::pair(std::stoi(a), a) < std::pair(std::stoi(b), b);
  };
  CHECK(std::is_sorted(method().in_order.begin(), method().in_order.end(), less));
  CHECK(method().in_order.size() == method().equations.size());
  for (int n = 1; n <= 54; ++n) CHECK(method().of_paper.contains(std::to_string(n)));
  static const std::regex number(R"(\((\d+[a-z]?)\))");
  for (const std::string& line : Markdown(read(kSource / "core/METHOD.md")).prose)
    for (std::sregex_iterator i(line.begin(), line.end(), number), end; i != end; ++i) {
      INFO(line);
      CHECK(method().equations.contains((*i)[1]));
    }
}

TEST_CASE("files and names that the method mentions exist in the code", "[citations]") {
  std::string code;
  for (const fs::path& file : sources())
    if (file.extension() == ".hpp" || file.extension() == ".cpp") code += read(file);
  static const std::regex path(R"(\b(?:core|collision|config|daemon|devices|tests|tools)/[\w/]+(?:\.\w+)?)"),
      name(R"(`([A-Za-z_][\w:]*)(?:<[^`]*>)?(?:\(\))?`)");
  for (const std::string& line : Markdown(read(kSource / "core/METHOD.md")).prose) {
    INFO(line);
    for (std::sregex_iterator i(line.begin(), line.end(), path), end; i != end; ++i) {
      INFO((*i)[0]);
      CHECK(fs::exists(kSource / (*i)[0].str()));
    }
    for (std::sregex_iterator i(line.begin(), line.end(), name), end; i != end; ++i) {
      const std::string whole = (*i)[1];
      const std::size_t colons = whole.rfind("::");
      INFO(whole);
      CHECK(code.find(colons == std::string::npos ? whole : whole.substr(colons + 2)) != std::string::npos);
    }
  }
}

TEST_CASE("each Markdown file that is named exists", "[citations]") {
  for (const fs::path& file : sources()) {
    const std::string where = name_of(file);
    if (where == "tests/test_guides" || where == kThisFile) continue;  // they name missing files on purpose
    for (const std::string& named : markdown_names_in(read(file))) {
      INFO(where << " names " << named);
      CHECK((fs::exists(kSource / named) || fs::exists(file.parent_path() / named)));
    }
  }
}

TEST_CASE("names of Markdown files are found in a text", "[citations]") {
  CHECK(markdown_names_in("see core/METHOD.md, section 3; [a](../b-c.md#d) /e.md; f.mdx .md g.cpp") ==
        std::vector<std::string>{"core/METHOD.md", "../b-c.md", "e.md"});
}

TEST_CASE("links of the guides lead to files and headings", "[citations]") {
  static const std::regex link(R"(\]\(([^)#\s]*)(#[^)\s]*)?\))");
  std::map<fs::path, std::set<std::string>> anchors;
  int links = 0;
  for (const fs::path& file : sources()) {
    if (file.extension() != ".md") continue;
    for (const std::string& line : Markdown(read(file)).prose)
      for (std::sregex_iterator i(line.begin(), line.end(), link), end; i != end; ++i) {
        const std::string target = (*i)[1], anchor = (*i)[2];
        if (target.find("://") != std::string::npos || target.starts_with("mailto:")) continue;
        ++links;
        INFO(name_of(file) << ": " << (*i)[0]);
        const fs::path to = target.empty() ? file : file.parent_path() / target;
        REQUIRE(fs::exists(to));
        if (anchor.empty()) continue;
        if (!anchors.contains(to)) anchors[to] = anchors_of(to);
        CHECK(anchors[to].contains(anchor.substr(1)));
      }
  }
  CHECK(links > 50);
}

}  // namespace wrenchd::test_citations
