/* Commands of the connection: Hello, AskCapabilities, AskStatistics, SetBaud, TestLink. */
#include "commands.h"

#include "action.h" // action_stop
#include "answers.h" // answer_accepted
#include "board_facts.h" // limits of the board
#include "hardware.h" // thermometer
#include "host_link.h" // host_link_greet
#include "kept.h" // kept_at_least
#include "limits.h" // turntable_reach
#include "line.h" // line_can
#include "outbox.h" // outbox_finish
#include "refusals.h" // refused_while_busy
#include "send_messages.h" // send_info
#include "turntable.h" // turntable_zero
#include "wiring.h" // one_switch

void on_hello(const struct command_frame *frame, const struct hello *hello)
{
    action_stop();
    action_forget();
    action_send_again(0, 0);
    host_link_greet(hello);
    send_info(&(struct info){
        .command = frame->sequence,
        .major = PROTOCOL_MAJOR,
        .minor = PROTOCOL_MINOR,
        .firmware = board_firmware(),
        .serial = board_serial(),
        .board = board_profile(),
        .temperature = thermometer(),
        .trace_rate = TRACE_RATE,
        .microsteps = MICROSTEPS,
        .boot = boot_count(),
        .homed = turntable_zero(),
    });
}

void on_ask_capabilities(const struct command_frame *frame)
{
    send_capabilities(&(struct capabilities){
        .command = frame->sequence,
        .features = TURNTABLE_FEATURES | RANGING_FEATURES | TRACE_FEATURES | FEATURE_INPUTS | FEATURE_WIRING |
                    (one_switch() ? FEATURE_ONE_SWITCH : 0) |
                    (thermometer() == NO_TEMPERATURE ? 0 : FEATURE_THERMOMETER),
        .lowest_angle = -turntable_reach() * 1000000L,
        .highest_angle = turntable_reach() * 1000000L,
        .steps = FULL_STEPS,
        .fastest = SPEED * MICRODEGREES_A_STEP,
        .hardest = ACCELERATION * (uint32_t)MICRODEGREES_A_STEP,
        .backlash = BACKLASH_DEGREES * 1000000L,
        .longest_listen_us = LISTEN_MOST_US,
        .shortest_blanking_us = BLANKING_LEAST_US,
        .shortest_rearm_us = REARM_LEAST_US,
        .most_pulses = PULSES_SENT,
        .most_echoes = ECHOES_MOST,
        .ping_period_us = PING_PERIOD_US,
        .fastest_trace = TRACE_RATE,
        .longest_trace = TRACE_SAMPLES,
        .fastest_baud = FASTEST_BAUD,
        .readings_kept = kept_at_least(ping_settings.echoes),
        .turning = {TURNING, sizeof TURNING - 1},
    });
}

void on_ask_statistics(const struct command_frame *frame)
{
    const struct receiver *receiver = host_link_receiver();
    send_statistics(&(struct statistics){
        .command = frame->sequence,
        .frames = receiver->frames,
        .rejected = receiver->rejected,
        .overruns = line_overruns(),
        .pings = action_pings(),
        .lost_steps = turntable_lost(),
        .reset_cause = reset_cause(),
        .stack_free = stack_free(),
    });
}

void on_set_baud(const struct command_frame *frame, const struct set_baud *request)
{
    if (refused_while_busy(frame))
        return;
    if (!line_can(request->baud)) {
        answer_out_of_range(frame, FLASH_TEXT("baud: expected 250000, 500000 or 1000000"));
        return;
    }
    answer_accepted(frame);
    host_link_change_baud(request->baud);
}

void on_test_link(const struct command_frame *frame, const struct test_link *request)
{
    if (!request->data.count || request->data.count > MAX_TEST || request->size > MAX_TESTED) {
        answer_out_of_range(frame, FLASH_TEXT("expected 1 to 64 bytes of data, size at most 480"));
        return;
    }
    send_link_tested(&(struct link_tested){
        .command = frame->sequence,
        .data = {.bytes = request->data.bytes, .count = request->size, .period = request->data.count},
    });
    outbox_finish(); // the bytes are in the receive buffer
}
