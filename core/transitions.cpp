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

constexpr StateSet all_except(StateSet set) noexcept {
  return static_cast<StateSet>(kEvery & ~set);
}
constexpr StateSet operator+(State a, State b) noexcept {
  return make_state_set(a, b);
}

constexpr Transition enters(Trigger trigger, StateSet from, State to, Reaction reaction, const char* why) {
  return {trigger, from, true, to, reaction, why};
}
constexpr Transition remains(Trigger trigger, StateSet from, const char* why, Reaction reaction = R::none) {
  return {trigger, from, false, State::disconnected, reaction, why};
}

// clang-format off
constexpr std::array kTransitions = {
    //      trigger                 from                                                                                      to                   reaction       reason
    enters( T::device_connected,    kNoDevice,                                                                                State::self_test,    R::none,       "the self-test checks every new device before force is possible"),
    remains(T::device_connected,    all_except(kNoDevice),                                                                    "the device is known already"),

    remains(T::device_disconnected, kNoDevice,                                                                                "no device was connected"),
    remains(T::device_disconnected, kLatched,                                                                                 "unplugging the device does not clear a latched fault", R::release),
    enters( T::device_disconnected, all_except(kNoDevice | kLatched),                                                         State::disconnected, R::release,    "a device that comes back is tested again and ends disarmed"),

    enters( T::self_test_passed,    make_state_set(State::self_test),                                                         State::disarmed,     R::none,       "force requires an explicit request"),
    remains(T::self_test_passed,    all_except(make_state_set(State::self_test)),                                             "no self-test is running"),
    enters( T::self_test_failed,    make_state_set(State::self_test),                                                         State::fault,        R::zero,       "a device that contradicts its profile gets no force"),
    remains(T::self_test_failed,    all_except(make_state_set(State::self_test)),                                             "no self-test is running"),

    enters( T::arm,                 make_state_set(State::disarmed),                                                          State::waiting,      R::none,       "no force before the hand is calm"),
    remains(T::arm,                 State::disconnected + State::self_test,                                                   "the device has not been tested yet"),
    remains(T::arm,                 make_state_set(State::waiting) | kRising,                                                 "it is armed already"),
    remains(T::arm,                 State::degraded + State::releasing,                                                       "the force is fading; wait until it is zero"),
    remains(T::arm,                 kLatched,                                                                                 "acknowledge the fault or stop first"),
    remains(T::arm,                 make_state_set(State::shutdown),                                                          "wrenchd has ended"),

    enters( T::calm,                make_state_set(State::waiting),                                                           State::ramping,      R::none,       "a slow ramp leaves the user time to release the handle"),
    remains(T::calm,                all_except(make_state_set(State::waiting)),                                               "the loop does not wait for a calm hand"),
    enters( T::ramp_done,           make_state_set(State::ramping),                                                           State::active,       R::none,       "full authority"),
    remains(T::ramp_done,           all_except(make_state_set(State::ramping)),                                               "no ramp is running"),

    enters( T::disarm,              make_state_set(State::waiting),                                                           State::disarmed,     R::zero,       "there is no force yet"),
    enters( T::disarm,              kRising | make_state_set(State::degraded),                                                State::releasing,    R::fade_100ms, "the force fades, so a hand that leans on a wall does not fall through it"),
    remains(T::disarm,              make_state_set(State::releasing),                                                         "the force is fading already", R::fade_100ms),
    remains(T::disarm,              all_except(make_state_set(State::waiting, State::degraded, State::releasing) | kRising),  "there is no force"),
    enters( T::fade_done,           make_state_set(State::releasing),                                                         State::disarmed,     R::zero,       "the hand is free"),
    remains(T::fade_done,           all_except(make_state_set(State::releasing)),                                             "no release is running"),

    enters( T::interrupted,         kRising | make_state_set(State::waiting, State::degraded),                                State::waiting,      R::zero,       "the contact force would change abruptly: the soft start begins again"),
    remains(T::interrupted,         all_except(kRising | make_state_set(State::waiting, State::degraded)),                    "no force is possible", R::zero),

    enters( T::soft_fault,          kRising | make_state_set(State::degraded),                                                State::degraded,     R::fade_10ms,  "one lost report interrupts the force for a moment and does not end the session"),
    enters( T::soft_fault,          make_state_set(State::waiting),                                                           State::waiting,      R::zero,       "the calm time starts again"),
    remains(T::soft_fault,          make_state_set(State::releasing),                                                         "the force fades faster now", R::fade_10ms),
    remains(T::soft_fault,          all_except(kRising | make_state_set(State::degraded, State::waiting, State::releasing)),  "there is no force"),
    enters( T::recovered,           make_state_set(State::degraded),                                                          State::ramping,      R::none,       "the fault has cleared; force comes back by a shorter ramp"),
    remains(T::recovered,           all_except(make_state_set(State::degraded)),                                              "the state is not degraded"),

    enters( T::hard_fault,          all_except(kNoDevice | kLatched),                                                         State::fault,        R::zero,       "a user must acknowledge before force is possible again"),
    remains(T::hard_fault,          kLatched,                                                                                 "the first cause remains"),
    remains(T::hard_fault,          kNoDevice,                                                                                "no device is connected"),

    enters( T::stop,                all_except(State::stopped + State::shutdown),                                             State::stopped,      R::zero,       "a stop request always counts"),
    remains(T::stop,                State::stopped + State::shutdown,                                                         "the loop is stopped already"),
    enters( T::acknowledge,         kLatched,                                                                                 State::self_test,    R::zero,       "the fault may have changed the device: the self-test runs again and ends disarmed"),
    remains(T::acknowledge,         all_except(kLatched),                                                                     "there is nothing to acknowledge"),

    enters( T::quit,                kRising | make_state_set(State::degraded),                                                State::releasing,    R::fade_100ms, "the force fades, so a hand that leans on a wall does not fall through it"),
    remains(T::quit,                make_state_set(State::releasing),                                                         "the force is fading already", R::fade_100ms),
    remains(T::quit,                make_state_set(State::shutdown),                                                          "wrenchd has ended"),
    enters( T::quit,                all_except(kRising | make_state_set(State::degraded, State::releasing, State::shutdown)), State::shutdown,     R::release,    "there is no force to fade"),
    enters( T::process_end,         kEvery,                                                                                   State::shutdown,     R::release,    "every end of the process releases the hand"),
    remains(T::info,                kEvery,                                                                                   "wrenchd reports it and changes nothing"),
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
constexpr std::array<const char*, kTriggerCount> kTriggerNames = {"device connected",
                                                                  "device disconnected",
                                                                  "self-test passed",
                                                                  "self-test failed",
                                                                  "arm",
                                                                  "calm",
                                                                  "ramp done",
                                                                  "disarm",
                                                                  "fade done",
                                                                  "interrupted",
                                                                  "soft fault",
                                                                  "recovered",
                                                                  "hard fault",
                                                                  "stop",
                                                                  "acknowledge",
                                                                  "quit",
                                                                  "process end",
                                                                  "info"};
constexpr std::array<const char*, 5> kReactionNames = {"none", "fade 100 ms", "fade 10 ms", "zero",
                                                       "release"};

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
