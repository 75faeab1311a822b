# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds the mutants of one C++ source: small changes of its text, each of which should turn a test red.

clang reads the source, so that each change knows the types it works on. A relation between real numbers is
reversed but never moved by its boundary; a relation between whole numbers is both.
"""

import dataclasses
import re

import clang.cindex as cindex
from clang.cindex import CursorKind as Kind
from clang.cindex import TypeKind


@dataclasses.dataclass(frozen=True)
class Mutant:
    """One change of one source: the bytes from `offset` on, `before`, become `after`."""

    file: str  # relative to the root of the source tree
    line: int  # counted from 1
    last_line: int  # of the statement that is changed
    function: str  # qualified name; empty outside of functions
    first_function_line: int
    last_function_line: int
    operator: str  # relation, arithmetic, logic, sign, step, constant, drop, extremum, condition
    offset: int
    before: str
    after: str
    declares: str = ""  # the constant or member that is given a value, outside of functions

    def apply(self, text: bytes) -> bytes:
        """The whole source with the change. Raises ValueError if the source has other text there."""
        old = self.before.encode()
        if text[self.offset : self.offset + len(old)] != old:
            raise ValueError(f"{self.file}:{self.line}: the source has changed since its mutants were listed")
        return text[: self.offset] + self.after.encode() + text[self.offset + len(old) :]

    @property
    def shown(self) -> str:
        """The change in one line, as the table of survivors and the list of explanations write it."""
        flat = lambda text: re.sub(r"\s+", " ", text).strip()
        if self.operator == "drop":
            return f"drop {flat(self.before)}"
        return f"{flat(self.before)} -> {flat(self.after) or '(nothing)'}"


REAL_RELATIONS = {"<": [">="], "<=": [">"], ">": ["<="], ">=": ["<"], "==": ["!="], "!=": ["=="]}
WHOLE_RELATIONS = {"<": ["<=", ">="], "<=": ["<", ">"], ">": [">=", "<="], ">=": [">", "<"], "==": ["!="], "!=": ["=="]}
ARITHMETIC = {"+": "-", "-": "+", "*": "/", "/": "*", "%": "/", "&": "|", "|": "&", "^": "&", "<<": ">>", ">>": "<<"}
COMPOUND = {"+=": "-=", "-=": "+=", "*=": "/=", "/=": "*=", "|=": "&=", "&=": "|=", "<<=": ">>=", ">>=": "<<="}
LOGIC = {"&&": "||", "||": "&&"}
EXTREMA = {
    "min": "max", "max": "min", "fmin": "fmax", "fmax": "fmin", "min_element": "max_element",
    "max_element": "min_element", "cwiseMin": "cwiseMax", "cwiseMax": "cwiseMin",
    "minCoeff": "maxCoeff", "maxCoeff": "minCoeff",
}  # fmt: skip
# Calls that change no result: room in memory, hints, and words for the log.
NEVER_DROPPED = {"reserve", "shrink_to_fit", "assert", "info", "warn", "debug", "trace", "static_cast"}

FUNCTIONS = {
    Kind.FUNCTION_DECL, Kind.CXX_METHOD, Kind.CONSTRUCTOR, Kind.DESTRUCTOR, Kind.CONVERSION_FUNCTION,
    Kind.FUNCTION_TEMPLATE,
}  # fmt: skip
LOOPS = {Kind.FOR_STMT, Kind.WHILE_STMT, Kind.DO_STMT, Kind.CXX_FOR_RANGE_STMT}
BUILT_IN_REAL = {TypeKind.FLOAT, TypeKind.DOUBLE, TypeKind.LONGDOUBLE}
WHOLE = {
    TypeKind.CHAR_U, TypeKind.UCHAR, TypeKind.CHAR_S, TypeKind.SCHAR, TypeKind.USHORT, TypeKind.UINT, TypeKind.ULONG,
    TypeKind.ULONGLONG, TypeKind.SHORT, TypeKind.INT, TypeKind.LONG, TypeKind.LONGLONG, TypeKind.ENUM,
}  # fmt: skip
# Literals below this are margins for rounding: twice as much says nothing, a thousand times does.
ROUNDING = 1e-6


def find_mutants(source: str, root: str, arguments: list[str], headers=()) -> dict[str, list[Mutant]]:
    """All mutants of the source `root`/`source` and of headers that it includes, by file.

    arguments: the compiler's, without input and output. What clang cannot read, such as a builtin of gcc, has no
    mutants. Raises ValueError if clang gives up.
    """
    unit = cindex.Index.create().parse(f"{root}/{source}", args=arguments + ["-w", "-Wno-everything"])
    errors = [d for d in unit.diagnostics if d.severity >= cindex.Diagnostic.Fatal]
    if errors:
        raise ValueError(f"{source}: clang cannot read it: {errors[0]}")
    found = {}
    for path in (source, *headers):
        with open(f"{root}/{path}", "rb") as file:
            found[path] = _Finder(path, f"{root}/{path}", file.read()).find(unit.cursor)
    return found


class _Finder:
    def __init__(self, path, file_name, text):
        self.path = path
        self.file_name = file_name
        self.text = text
        self.found = {}
        self.function = None
        self.statement = None
        self.declared = ""

    def find(self, top):
        for child in top.get_children():
            if self._here(child):
                self._visit(child, [])
        return sorted(self.found.values(), key=lambda m: (m.offset, m.operator, m.after))

    def _here(self, cursor):
        file = cursor.extent.start.file
        return file is not None and file.name == self.file_name

    def _visit(self, cursor, parents):
        kind = cursor.kind
        if kind in (Kind.STATIC_ASSERT, Kind.ENUM_CONSTANT_DECL, Kind.TYPEDEF_DECL, Kind.TYPE_ALIAS_DECL,
                    Kind.TEMPLATE_NON_TYPE_PARAMETER, Kind.FRIEND_DECL):  # fmt: skip
            return
        if kind.is_attribute():
            return
        if kind in FUNCTIONS and not cursor.is_definition():
            return
        outer = self.function, self.statement, self.declared
        if kind in (Kind.VAR_DECL, Kind.FIELD_DECL) and self.function is None:
            self.declared = cursor.spelling
        if kind in FUNCTIONS:
            self.function = cursor
        if kind.is_statement() and kind != Kind.COMPOUND_STMT:
            self.statement = cursor
        elif parents and parents[-1].kind == Kind.COMPOUND_STMT and kind != Kind.COMPOUND_STMT:
            self.statement = cursor
        if self._here(cursor):
            self._mutate(cursor, parents)
        if kind == Kind.CALL_EXPR and cursor.spelling in NEVER_DROPPED:
            return
        parents.append(cursor)
        for child in self._children(cursor):
            self._visit(child, parents)
        parents.pop()
        self.function, self.statement, self.declared = outer

    def _children(self, cursor):
        """The children that hold values: template arguments, array sizes and case labels do not."""
        children = list(cursor.get_children())
        kind = cursor.kind
        if kind in (Kind.DECL_REF_EXPR, Kind.TYPE_REF, Kind.TEMPLATE_REF):
            return []
        if kind == Kind.MEMBER_REF_EXPR:
            return [c for c in children if not c.kind.name.endswith("_LITERAL")]
        if kind in (Kind.VAR_DECL, Kind.FIELD_DECL, Kind.PARM_DECL):
            name_at = cursor.location.offset
            after = [c for c in children if c.kind.is_expression() and c.extent.start.offset > name_at]
            return [c for c in after[-1:] if not self._is_array_size(c)]
        if kind == Kind.CASE_STMT:
            return children[1:]
        if kind in FUNCTIONS:
            return [c for c in children if c.kind in (Kind.COMPOUND_STMT, Kind.CXX_TRY_STMT) or
                    (kind == Kind.CONSTRUCTOR and c.kind.is_expression())]  # fmt: skip
        if kind == Kind.CXX_FUNCTIONAL_CAST_EXPR or kind == Kind.CXX_STATIC_CAST_EXPR:
            return children[-1:]
        return children

    def _is_array_size(self, cursor):
        return self.text[: cursor.extent.start.offset].rstrip().endswith(b"[")

    def _mutate(self, cursor, parents):
        kind = cursor.kind
        if kind in (Kind.BINARY_OPERATOR, Kind.COMPOUND_ASSIGNMENT_OPERATOR):
            self._binary(cursor, parents)
        elif kind == Kind.UNARY_OPERATOR:
            self._unary(cursor, parents)
        elif kind == Kind.CALL_EXPR:
            self._call(cursor, parents)
        elif kind in (Kind.INTEGER_LITERAL, Kind.FLOATING_LITERAL, Kind.CXX_BOOL_LITERAL_EXPR):
            self._literal(cursor)
        elif kind in (Kind.IF_STMT, Kind.CONDITIONAL_OPERATOR):
            self._condition(cursor)
        if parents:
            self._statement(cursor, parents)

    # -- positions in the source ---------------------------------------------------------------------------------

    def _source(self, cursor):
        return self.text[cursor.extent.start.offset : cursor.extent.end.offset].decode()

    def _operator_between(self, left, right, names):
        """Offset and text of the operator between two operands; None if a macro made it."""
        start, end = left.extent.end.offset, right.extent.start.offset
        between = re.sub(rb"//[^\n]*|/\*.*?\*/", lambda m: b" " * len(m.group()), self.text[start:end], flags=re.S)
        found = re.search(rb"[-+*/%<>=!&|^]+", between)
        if not found or found.group().decode() not in names:
            return None
        return start + found.start(), found.group().decode()

    def _add(self, operator, offset, before, after, at=None):
        if self.text[offset : offset + len(before.encode())].decode(errors="replace") != before:
            return  # inside of a macro
        line = self.text.count(b"\n", 0, offset) + 1
        statement = self.statement
        last = statement.extent.end.line if statement is not None and statement.extent.end.line >= line else line
        name, first_line, last_line = "", line, line
        if self.function is not None:
            name = _qualified(self.function)
            first_line, last_line = self.function.extent.start.line, self.function.extent.end.line
        if statement is not None and statement.kind not in (Kind.DECL_STMT, Kind.RETURN_STMT) and \
                not statement.kind.is_expression():  # fmt: skip
            last = line  # a condition: its body is not part of it
        declares = "" if self.function is not None else self.declared
        mutant = Mutant(self.path, line, last, name, first_line, last_line, operator, offset, before, after, declares)
        self.found.setdefault((offset, before, after), mutant)

    # -- operators ------------------------------------------------------------------------------------------

    def _binary(self, cursor, parents):
        children = list(cursor.get_children())
        if len(children) != 2:
            return
        self._operator(cursor, children[0], children[1], parents)

    def _operator(self, cursor, left, right, parents):
        names = set(REAL_RELATIONS) | set(ARITHMETIC) | set(COMPOUND) | set(LOGIC)
        place = self._operator_between(left, right, names)
        if place is None:
            return
        offset, name = place
        types = [_shape(left), _shape(right)]
        if name in REAL_RELATIONS:
            real = "real" in types
            if self._steers_a_loop(cursor, parents):
                if not real and name in ("<", "<=") and "whole" in types:
                    end = right.extent.end.offset
                    bound = self._source(right)
                    self._add("relation", right.extent.start.offset, bound, f"({bound}) - 1")
                return
            relations = REAL_RELATIONS if real or "whole" not in types else WHOLE_RELATIONS
            for other in relations[name]:
                self._add("relation", offset, name, other)
        elif name in LOGIC:
            self._add("logic", offset, name, LOGIC[name])
        elif name in COMPOUND:
            if "text" not in types and "pointer" not in types:
                self._add("arithmetic", offset, name, COMPOUND[name])
        elif "text" not in types and "pointer" not in types and "stream" not in types:
            if cursor.kind == Kind.CALL_EXPR and name not in "+-&|":
                return  # a product of matrices or rotations has no quotient
            self._add("arithmetic", offset, name, ARITHMETIC[name])

    def _steers_a_loop(self, cursor, parents):
        """Whether the cursor is the condition of a loop, or a part of it."""
        inner = cursor
        for parent in reversed(parents):
            if parent.kind in LOOPS:
                children = list(parent.get_children())
                body = children[0] if parent.kind == Kind.DO_STMT else children[-1]
                return not _within(inner, body)
            if parent.kind in FUNCTIONS or parent.kind == Kind.COMPOUND_STMT or parent.kind == Kind.LAMBDA_EXPR:
                return False
            inner = parent
        return False

    def _unary(self, cursor, parents):
        operand = next(iter(cursor.get_children()), None)
        if operand is None:
            return
        start, end = cursor.extent.start.offset, cursor.extent.end.offset
        prefix = self.text[start : operand.extent.start.offset].decode(errors="replace").strip()
        suffix = self.text[operand.extent.end.offset : end].decode(errors="replace").strip()
        if prefix == "!" and operand.kind == Kind.PAREN_EXPR and _is_relation(_bare(operand)):
            return  # the relation operator does this
        if prefix in ("-", "!", "~"):
            self._add("sign", start, prefix, "")
        elif prefix in ("++", "--") or suffix in ("++", "--"):
            if self._steers_a_loop(cursor, parents) or _shape(operand) == "pointer":
                return
            name = prefix or suffix
            offset = start if prefix else self.text.index(suffix.encode(), operand.extent.end.offset)
            self._add("step", offset, name, "--" if name == "++" else "++")

    def _call(self, cursor, parents):
        name = cursor.spelling
        children = list(cursor.get_children())
        if name.startswith("operator"):
            symbol = name[len("operator") :]
            if len(children) == 3:
                self._operator(cursor, children[0], children[2], parents)
            elif len(children) == 2 and symbol in ("-", "!", "~"):
                offset = cursor.extent.start.offset
                if self.text[offset : offset + 1].decode() == symbol:
                    self._add("sign", offset, symbol, "")
            return
        if name in EXTREMA:
            start, end = cursor.extent.start.offset, cursor.extent.end.offset
            callee = children[0].extent.end.offset if children else start
            found = None
            for match in re.finditer(rb"\b" + name.encode() + rb"\b", self.text[start:end]):
                if match.end() + start >= callee or found is None:
                    found = match
                    break
            if name in ("minCoeff", "maxCoeff", "cwiseMin", "cwiseMax"):
                inner = children[0].extent.end.offset if children else end
                found = re.compile(rb"\b" + name.encode() + rb"$").search(self.text[start:inner])
            if found:
                self._add("extremum", start + found.start(), name, EXTREMA[name])

    def _literal(self, cursor):
        offset = cursor.extent.start.offset
        word = re.match(rb"(?:0[xX][0-9a-fA-F']+[uUlLzZ]*|\.?[0-9](?:[eE][-+]|[0-9a-zA-Z_.'])*|true|false)",
                        self.text[offset : offset + 64])  # fmt: skip
        if not word:
            return  # made by a macro
        before = word.group().decode()
        for after in _other_literals(before):
            self._add("constant", offset, before, after)

    def _condition(self, cursor):
        children = list(cursor.get_children())
        if cursor.kind == Kind.IF_STMT:
            if re.match(rb"if\s+(constexpr|consteval)", self.text[cursor.extent.start.offset :]):
                return
            children = [c for c in children if c.kind.is_expression() or c.kind == Kind.DECL_STMT]
            if any(c.kind == Kind.DECL_STMT for c in children[:1]) and len(children) > 1:
                children = children[1:]
        if not children or not children[0].kind.is_expression():
            return
        condition = children[0]
        text = self._source(condition)
        inner = _bare(condition)
        if inner.kind == Kind.UNARY_OPERATOR and text.startswith("!"):
            return  # the sign operator does this
        if inner.kind == Kind.BINARY_OPERATOR or inner.spelling.startswith("operator"):
            parts = list(inner.get_children())
            place = self._operator_between(parts[0], parts[-1], set(REAL_RELATIONS)) if len(parts) > 1 else None
            if place:
                return  # the relation operator does this
        self._add("condition", condition.extent.start.offset, text, f"!({text})")

    # -- statements -----------------------------------------------------------------------------------------

    def _statement(self, cursor, parents):
        parent = parents[-1]
        bodies = {Kind.COMPOUND_STMT, Kind.IF_STMT, Kind.FOR_STMT, Kind.WHILE_STMT, Kind.CXX_FOR_RANGE_STMT,
                  Kind.CASE_STMT, Kind.DEFAULT_STMT, Kind.DO_STMT}  # fmt: skip
        if parent.kind not in bodies or not self._stands_alone(cursor, parent):
            return
        text = self._source(cursor)
        if cursor.kind in (Kind.RETURN_STMT, Kind.BREAK_STMT, Kind.CONTINUE_STMT):
            if cursor.kind == Kind.RETURN_STMT and self._is_last(cursor, parents):
                return
            self._add("drop", cursor.extent.start.offset, text, "")
            return
        expression = _bare(cursor)
        if expression.kind in (Kind.CALL_EXPR, Kind.CXX_THROW_EXPR, Kind.COMPOUND_ASSIGNMENT_OPERATOR) or (
            expression.kind == Kind.BINARY_OPERATOR
        ):
            if expression.kind == Kind.CALL_EXPR and (expression.spelling in NEVER_DROPPED or text.startswith("assert")):
                return
            self._add("drop", cursor.extent.start.offset, text, "")
        elif expression.kind == Kind.UNARY_OPERATOR and ("++" in text or "--" in text):
            self._add("drop", cursor.extent.start.offset, text, "")

    def _stands_alone(self, cursor, parent):
        """Returns whether the cursor is a complete statement: a semicolon follows, and no condition precedes it."""
        behind = self.text[cursor.extent.end.offset : cursor.extent.end.offset + 40].lstrip()
        if not behind.startswith(b";"):
            return False
        if parent.kind == Kind.COMPOUND_STMT:
            return True
        children = list(parent.get_children())
        if parent.kind in (Kind.CASE_STMT, Kind.DEFAULT_STMT):
            return cursor == children[-1]
        if parent.kind == Kind.DO_STMT:
            return cursor == children[0]
        if parent.kind == Kind.IF_STMT:
            before = self.text[: cursor.extent.start.offset].rstrip()
            return before.endswith(b")") or before.endswith(b"else")
        return cursor == children[-1]

    def _is_last(self, cursor, parents):
        """Whether the return is the last statement of its function: without it there would be none."""
        if len(parents) < 2 or parents[-1].kind != Kind.COMPOUND_STMT:
            return False
        if parents[-2].kind not in FUNCTIONS and parents[-2].kind != Kind.LAMBDA_EXPR:
            return False
        return list(parents[-1].get_children())[-1] == cursor


def _within(inner, outer):
    return outer.extent.start.offset <= inner.extent.start.offset and inner.extent.end.offset <= outer.extent.end.offset


def _bare(cursor):
    """The expression without the wrappers that clang puts around it."""
    while cursor.kind in (Kind.UNEXPOSED_EXPR, Kind.PAREN_EXPR):
        children = list(cursor.get_children())
        if len(children) != 1:
            break
        cursor = children[0]
    return cursor


def _is_relation(cursor):
    return cursor.kind == Kind.BINARY_OPERATOR and cursor.type.get_canonical().kind == TypeKind.BOOL and \
        not any(t.spelling in LOGIC for t in cursor.get_tokens())  # fmt: skip


def _shape(cursor):
    """Returns the class of an operand: real, whole, pointer, text, stream or other."""
    kind = cursor.type.get_canonical()
    if kind.kind in (TypeKind.LVALUEREFERENCE, TypeKind.RVALUEREFERENCE):
        kind = kind.get_pointee().get_canonical()
    if kind.kind in BUILT_IN_REAL:
        return "real"
    if kind.kind in WHOLE:
        return "whole"
    if kind.kind in (TypeKind.POINTER, TypeKind.NULLPTR, TypeKind.CONSTANTARRAY, TypeKind.INCOMPLETEARRAY):
        return "pointer"
    name = kind.spelling
    if "basic_string" in name or "filesystem::path" in name:
        return "text"
    if "ostream" in name or "istream" in name or "stringstream" in name:
        return "stream"
    if "iterator" in name:
        return "pointer"
    return "other"


def _other_literals(word):
    if word in ("true", "false"):
        return ["false" if word == "true" else "true"]
    digits = word.replace("'", "")
    if re.fullmatch(r"0[xX][0-9a-fA-F]+[uUlLzZ]*", digits) or re.fullmatch(r"[0-9]+[uUlLzZ]*", digits):
        number = re.match(r"0[xX][0-9a-fA-F]+|[0-9]+", digits).group()
        suffix = digits[len(number) :]
        value = int(number, 16) if number[:2].lower() == "0x" else int(number)
        shown = (lambda v: hex(v)) if number[:2].lower() == "0x" else str
        return [shown(1) + suffix] if value == 0 else ["0" + suffix, "2" + suffix] if value == 1 else [shown(value + 1) + suffix]
    number = re.match(r"[0-9.]*(?:[eE][-+]?[0-9]+)?", digits).group()
    suffix = digits[len(number) :]
    value = float(number)
    if value == 0.0:
        return ["1.0" + suffix]
    if value == 1.0:
        return ["0.0" + suffix, "2.0" + suffix]
    scales = (1e3, 1e-3) if abs(value) < ROUNDING else (2.0, 0.5)
    return [_real(value * scale) + suffix for scale in scales]


def _real(value):
    text = repr(float(f"{value:.12g}"))
    return text


def _qualified(cursor):
    parts = []
    while cursor is not None and cursor.kind != Kind.TRANSLATION_UNIT:
        if cursor.kind != Kind.NAMESPACE and cursor.spelling:
            parts.append(cursor.spelling)
        cursor = cursor.semantic_parent
    return "::".join(reversed(parts))
