// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/transitions.hpp"

namespace wrenchd {
namespace {

using T = Trigger;
using R = Reaction;

constexpr StateSet kNoDevice = set_of(State::disconnected, State::shutdown);
constexpr StateSet kRising = set_of(State::ramping, State::active);
constexpr StateSet kLatched = set_of(State::fault, State::stopped);
constexpr StateSet kEvery = (1U << kStateCount) - 1;

constexpr StateSet but(StateSet set) noexcept {
  return static_cast<StateSet>(kEvery & ~set);
}
constexpr StateSet operator+(State a, State b) noexcept {
  return set_of(a, b);
}

constexpr Transition leads(Trigger trigger, StateSet from, State to, Reaction reaction, const char* why) {
  return {trigger, from, true, to, reaction, why};
}
constexpr Transition stays(Trigger trigger, StateSet from, const char* why, Reaction reaction = R::none) {
  return {trigger, from, false, State::disconnected, reaction, why};
}

// clang-format off
constexpr std::array kTransitions = {
    //    trigger          from                                              to                reaction       why
    leads(T::device_there, kNoDevice,                                        State::self_test, R::none,       "it has to show what it can do before anybody trusts it"),
    stays(T::device_there, but(kNoDevice),                                   "it was there before"),

    stays(T::device_gone,  kNoDevice,                                        "there was none"),
    stays(T::device_gone,  kLatched,                                         "what was wrong is not mended by pulling the plug", R::let_go),
    leads(T::device_gone,  but(kNoDevice | kLatched),                        State::disconnected, R::let_go,  "whatever comes back is looked at anew, and lands disarmed"),

    leads(T::passed,       set_of(State::self_test),                         State::disarmed,  R::none,       "force is given when somebody asks for it, never before"),
    stays(T::passed,       but(set_of(State::self_test)),                    "no self-test is running"),
    leads(T::failed,       set_of(State::self_test),                         State::fault,     R::zero,       "a device that does not do as its profile says gets no force"),
    stays(T::failed,       but(set_of(State::self_test)),                    "no self-test is running"),

    leads(T::arm,          set_of(State::disarmed),                          State::waiting,   R::none,       "no force before the hand is calm"),
    stays(T::arm,          State::disconnected + State::self_test,           "the device has not been tested yet"),
    stays(T::arm,          set_of(State::waiting) | kRising,                 "it is armed already"),
    stays(T::arm,          State::degraded + State::releasing,               "the force is on its way to zero; wait until it is there"),
    stays(T::arm,          kLatched,                                         "acknowledge what happened first"),
    stays(T::arm,          set_of(State::shutdown),                          "it has ended"),

    leads(T::calm,         set_of(State::waiting),                           State::ramping,   R::none,       "a slow rise gives the hand time to let go"),
    stays(T::calm,         but(set_of(State::waiting)),                      "nobody waits for it"),
    leads(T::ramped,       set_of(State::ramping),                           State::active,    R::none,       "full authority"),
    stays(T::ramped,       but(set_of(State::ramping)),                      "nothing was rising"),

    leads(T::disarm,       set_of(State::waiting),                           State::disarmed,  R::zero,       "there was no force yet"),
    leads(T::disarm,       kRising | set_of(State::degraded),                State::releasing, R::fade_100ms, "a hand that leans on a wall must not fall through it"),
    stays(T::disarm,       set_of(State::releasing),                         "it is on its way", R::fade_100ms),
    stays(T::disarm,       but(set_of(State::waiting, State::degraded, State::releasing) | kRising), "there is no force"),
    leads(T::faded,        set_of(State::releasing),                         State::disarmed,  R::zero,       "the hand is free"),
    stays(T::faded,        but(set_of(State::releasing)),                    "nothing was released"),

    leads(T::interrupted,  kRising | set_of(State::waiting, State::degraded), State::waiting,  R::zero,       "what the hand would feel has changed under it: start as after arming"),
    stays(T::interrupted,  but(kRising | set_of(State::waiting, State::degraded)), "there is no force to come", R::zero),

    leads(T::soft_fault,   kRising | set_of(State::degraded),                State::degraded,  R::fade_10ms,  "one lost report must cost a moment, not the session"),
    leads(T::soft_fault,   set_of(State::waiting),                           State::waiting,   R::zero,       "the time of calm begins anew"),
    stays(T::soft_fault,   set_of(State::releasing),                         "it goes faster now", R::fade_10ms),
    stays(T::soft_fault,   but(kRising | set_of(State::degraded, State::waiting, State::releasing)), "there is no force"),
    leads(T::clean,        set_of(State::degraded),                          State::ramping,   R::none,       "what was wrong has passed; force comes back as it came, only sooner"),
    stays(T::clean,        but(set_of(State::degraded)),                     "nothing was wrong"),

    leads(T::hard_fault,   but(kNoDevice | kLatched),                        State::fault,     R::zero,       "somebody has to look at it before the hand is pushed again"),
    stays(T::hard_fault,   kLatched,                                         "the first cause is kept"),
    stays(T::hard_fault,   kNoDevice,                                        "there is nobody to protect"),

    leads(T::stop,         but(State::stopped + State::shutdown),            State::stopped,   R::zero,       "whoever says stop is right"),
    stays(T::stop,         State::stopped + State::shutdown,                 "it is stopped"),
    leads(T::acknowledge,  kLatched,                                         State::self_test, R::zero,       "what was wrong may have changed the device: it is tested as a new one, and lands disarmed"),
    stays(T::acknowledge,  but(kLatched),                                    "there is nothing to acknowledge"),

    leads(T::quit,         kRising | set_of(State::degraded),                State::releasing, R::fade_100ms, "a hand that leans on a wall must not fall through it"),
    stays(T::quit,         set_of(State::releasing),                         "it is on its way", R::fade_100ms),
    stays(T::quit,         set_of(State::shutdown),                          "it has ended"),
    leads(T::quit,         but(kRising | set_of(State::degraded, State::releasing, State::shutdown)), State::shutdown, R::let_go, "there is no force to fade"),
    leads(T::end,          kEvery,                                           State::shutdown,  R::let_go,     "no way out of the process but through a release"),
    stays(T::noted,        kEvery,                                           "it is told, and nothing else"),
};
// clang-format on

constexpr bool each_pair_has_one_row() {
  for (std::size_t t = 0; t < kTriggerCount; ++t)
    for (std::size_t s = 0; s < kStateCount; ++s) {
      int rows = 0;
      for (const Transition& row : kTransitions)
        rows += row.trigger == static_cast<Trigger>(t) && contains(row.from, static_cast<State>(s)) ? 1 : 0;
      if (rows != 1) return false;
    }
  return true;
}
static_assert(each_pair_has_one_row(), "every trigger has exactly one row for every state");

/// The same by trigger and state, so that a lookup is one.
constexpr auto kRowOf = [] {
  std::array<std::array<std::uint8_t, kStateCount>, kTriggerCount> index{};
  for (std::size_t i = 0; i < kTransitions.size(); ++i)
    for (std::size_t s = 0; s < kStateCount; ++s)
      if (contains(kTransitions[i].from, static_cast<State>(s)))
        index[static_cast<std::size_t>(kTransitions[i].trigger)][s] = static_cast<std::uint8_t>(i);
  return index;
}();

constexpr std::array<const char*, kStateCount> kStateNames = {
    "disconnected", "self-test", "disarmed", "waiting", "ramping", "active",
    "degraded",     "releasing", "fault",    "stopped", "shutdown"};
constexpr std::array<const char*, kTriggerCount> kTriggerNames = {
    "device there", "device gone", "passed",      "failed",      "arm",        "calm",
    "ramped",       "disarm",      "faded",       "interrupted", "soft fault", "clean",
    "hard fault",   "stop",        "acknowledge", "quit",        "end",        "noted"};
constexpr std::array<const char*, 5> kReactionNames = {"none", "fade 100 ms", "fade 10 ms", "zero", "let go"};

template <std::size_t N>
const char* name_in(const std::array<const char*, N>& names, std::size_t i) noexcept {
  return i < N ? names[i] : "unknown";
}

}  // namespace

const char* name(State state) noexcept {
  return name_in(kStateNames, static_cast<std::size_t>(state));
}
const char* name(Trigger trigger) noexcept {
  return name_in(kTriggerNames, static_cast<std::size_t>(trigger));
}
const char* name(Reaction reaction) noexcept {
  return name_in(kReactionNames, static_cast<std::size_t>(reaction));
}

std::span<const Transition> transitions() noexcept {
  return kTransitions;
}

const Transition& transition(Trigger trigger, State from) noexcept {
  return kTransitions[kRowOf[static_cast<std::size_t>(trigger)][static_cast<std::size_t>(from)]];
}

}  // namespace wrenchd
