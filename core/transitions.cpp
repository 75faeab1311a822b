// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/transitions.hpp"

namespace wrenchd {
namespace {

using T = Trigger;
using R = Reaction;

constexpr StateSet kNoDevice = make_state_set(State::disconnected, State::shutdown);
constexpr StateSet kRising = make_state_set(State::ramping, State::active);
constexpr StateSet kLatched = make_state_set(State::fault, State::stopped);
constexpr StateSet kEvery = (1U << kStateCount) - 1;

constexpr StateSet but(StateSet set) noexcept {
  return static_cast<StateSet>(kEvery & ~set);
}
constexpr StateSet operator+(State a, State b) noexcept {
  return make_state_set(a, b);
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
    leads(T::device_connected, kNoDevice,                                        State::self_test, R::none,       "it has to show what it can do before anybody trusts it"),
    stays(T::device_connected, but(kNoDevice),                                   "it was there before"),

    stays(T::device_disconnected,  kNoDevice,                                        "there was none"),
    stays(T::device_disconnected,  kLatched,                                         "what was wrong is not mended by pulling the plug", R::release),
    leads(T::device_disconnected,  but(kNoDevice | kLatched),                        State::disconnected, R::release,  "whatever comes back is looked at anew, and lands disarmed"),

    leads(T::self_test_passed,       make_state_set(State::self_test),                         State::disarmed,  R::none,       "force is given when somebody asks for it, never before"),
    stays(T::self_test_passed,       but(make_state_set(State::self_test)),                    "no self-test is running"),
    leads(T::self_test_failed,       make_state_set(State::self_test),                         State::fault,     R::zero,       "a device that does not do as its profile says gets no force"),
    stays(T::self_test_failed,       but(make_state_set(State::self_test)),                    "no self-test is running"),

    leads(T::arm,          make_state_set(State::disarmed),                          State::waiting,   R::none,       "no force before the hand is calm"),
    stays(T::arm,          State::disconnected + State::self_test,           "the device has not been tested yet"),
    stays(T::arm,          make_state_set(State::waiting) | kRising,                 "it is armed already"),
    stays(T::arm,          State::degraded + State::releasing,               "the force is on its way to zero; wait until it is there"),
    stays(T::arm,          kLatched,                                         "acknowledge what happened first"),
    stays(T::arm,          make_state_set(State::shutdown),                          "it has ended"),

    leads(T::calm,         make_state_set(State::waiting),                           State::ramping,   R::none,       "a slow rise gives the hand time to let go"),
    stays(T::calm,         but(make_state_set(State::waiting)),                      "nobody waits for it"),
    leads(T::ramp_done,       make_state_set(State::ramping),                           State::active,    R::none,       "full authority"),
    stays(T::ramp_done,       but(make_state_set(State::ramping)),                      "nothing was rising"),

    leads(T::disarm,       make_state_set(State::waiting),                           State::disarmed,  R::zero,       "there was no force yet"),
    leads(T::disarm,       kRising | make_state_set(State::degraded),                State::releasing, R::fade_100ms, "a hand that leans on a wall must not fall through it"),
    stays(T::disarm,       make_state_set(State::releasing),                         "it is on its way", R::fade_100ms),
    stays(T::disarm,       but(make_state_set(State::waiting, State::degraded, State::releasing) | kRising), "there is no force"),
    leads(T::fade_done,        make_state_set(State::releasing),                         State::disarmed,  R::zero,       "the hand is free"),
    stays(T::fade_done,        but(make_state_set(State::releasing)),                    "nothing was released"),

    leads(T::interrupted,  kRising | make_state_set(State::waiting, State::degraded), State::waiting,  R::zero,       "what the hand would feel has changed under it: start as after arming"),
    stays(T::interrupted,  but(kRising | make_state_set(State::waiting, State::degraded)), "there is no force to come", R::zero),

    leads(T::soft_fault,   kRising | make_state_set(State::degraded),                State::degraded,  R::fade_10ms,  "one lost report must cost a moment, not the session"),
    leads(T::soft_fault,   make_state_set(State::waiting),                           State::waiting,   R::zero,       "the time of calm begins anew"),
    stays(T::soft_fault,   make_state_set(State::releasing),                         "it goes faster now", R::fade_10ms),
    stays(T::soft_fault,   but(kRising | make_state_set(State::degraded, State::waiting, State::releasing)), "there is no force"),
    leads(T::recovered,        make_state_set(State::degraded),                          State::ramping,   R::none,       "what was wrong has passed; force comes back as it came, only sooner"),
    stays(T::recovered,        but(make_state_set(State::degraded)),                     "nothing was wrong"),

    leads(T::hard_fault,   but(kNoDevice | kLatched),                        State::fault,     R::zero,       "somebody has to look at it before the hand is pushed again"),
    stays(T::hard_fault,   kLatched,                                         "the first cause is kept"),
    stays(T::hard_fault,   kNoDevice,                                        "there is nobody to protect"),

    leads(T::stop,         but(State::stopped + State::shutdown),            State::stopped,   R::zero,       "whoever says stop is right"),
    stays(T::stop,         State::stopped + State::shutdown,                 "it is stopped"),
    leads(T::acknowledge,  kLatched,                                         State::self_test, R::zero,       "what was wrong may have changed the device: it is tested as a new one, and lands disarmed"),
    stays(T::acknowledge,  but(kLatched),                                    "there is nothing to acknowledge"),

    leads(T::quit,         kRising | make_state_set(State::degraded),                State::releasing, R::fade_100ms, "a hand that leans on a wall must not fall through it"),
    stays(T::quit,         make_state_set(State::releasing),                         "it is on its way", R::fade_100ms),
    stays(T::quit,         make_state_set(State::shutdown),                          "it has ended"),
    leads(T::quit,         but(kRising | make_state_set(State::degraded, State::releasing, State::shutdown)), State::shutdown, R::release, "there is no force to fade"),
    leads(T::process_end,          kEvery,                                           State::shutdown,  R::release,     "no way out of the process but through a release"),
    stays(T::info,        kEvery,                                           "it is told, and nothing else"),
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

/// Index of the row for each trigger and state.
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
