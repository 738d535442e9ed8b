/* Commands of the turntable: Home, SetZero, Turn, ConfigureTurntable, ConfigureWiring. */
#include "commands.h"

#include "action.h" // action_home, action_turn
#include "answers.h" // answer_accepted
#include "board_facts.h" // SPEED
#include "homing_facts.h" // enum homing
#include "manner.h" // struct turntable_manner
#include "refusals.h" // refused_while_busy
#include "send_messages.h" // send_turntable_settings
#include "turntable.h" // turntable_home
#include "wiring.h" // wiring_now

void on_home(const struct command_frame *frame)
{
    if (refused_while_busy(frame))
        return;
    if (HOMING == HOMING_BY_HAND)
        answer_out_of_range(frame, FLASH_TEXT("the turntable has no zero mark; turn it to zero by hand and send SetZero"));
    else
        action_home(frame);
}

void on_set_zero(const struct command_frame *frame)
{
    if (refused_while_busy(frame))
        return;
    if (HOMING == HOMING_ABSOLUTE) {
        answer_out_of_range(frame, FLASH_TEXT("the zero of a servo cannot be set; send Home"));
        return;
    }
    turntable_set_zero();
    answer_accepted(frame);
}

void on_turn(const struct command_frame *frame, const struct turn *order)
{
    if (refused_while_busy(frame))
        return;
    if (order->relative > 1)
        answer_out_of_range(frame, FLASH_TEXT("relative: expected 0 or 1"));
    else if (order->relative && !turntable_can_jog(order->angle))
        answer_out_of_range(frame, FLASH_TEXT("a jog of at most 10 degrees, within the limits of the cable, is possible"));
    else if (order->relative)
        action_jog(frame, order->angle);
    else if (!refused_angle(frame, order->angle))
        action_turn(frame, order->angle);
}

void on_configure_wiring(const struct command_frame *frame, const struct configure_wiring *request)
{
    if (refused_while_busy(frame))
        return;
    uint8_t all = WIRING_MARK | WIRING_CAM | WIRING_MOTOR | (HOMING == HOMING_WITH_SWITCHES ? WIRING_ONE_SWITCH : 0);
    if (request->change & ~all || request->inverted & ~request->change) {
        answer_out_of_range(frame, HOMING == HOMING_WITH_SWITCHES
                                       ? FLASH_TEXT("change: expected 0 to 15; inverted: only what is in change")
                                       : FLASH_TEXT("change: expected 0 to 7; inverted: only what is in change"));
        return;
    }
    if (request->change)
        turntable_invert(request->change, request->inverted);
    send_wiring_settings(&(struct wiring_settings){.command = frame->sequence, .inverted = wiring_now()});
}

static uint32_t microsteps(uint32_t microdegrees)
{
    return microdegrees ? 1 + (microdegrees - 1) / MICRODEGREES_A_STEP : 0;
}

void on_configure_turntable(const struct command_frame *frame, const struct configure_turntable *request)
{
    if (refused_while_busy(frame))
        return;
    if (request->approach > APPROACH_CLOCKWISE) {
        answer_out_of_range(frame, FLASH_TEXT("approach: expected 0, 1 or 2"));
        return;
    }
    uint32_t speed = microsteps(request->speed);
    turntable_set_manner((struct turntable_manner){
        .speed = speed < SPEED ? (uint16_t)speed : SPEED,
        .acceleration = microsteps(request->acceleration),
        .settle_us = request->settle_us,
        .approach = request->approach,
    });
    struct turntable_manner manner = turntable_manner();
    send_turntable_settings(&(struct turntable_settings){
        .command = frame->sequence,
        .speed = manner.speed * (uint32_t)MICRODEGREES_A_STEP,
        .acceleration = manner.acceleration * MICRODEGREES_A_STEP,
        .settle_us = manner.settle_us,
        .approach = manner.approach,
    });
}
