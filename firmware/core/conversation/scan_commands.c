/* Commands of a scan: Configure, StartScan, Stop, Resend. */
#include "commands.h"

#include "action.h" // action_scan
#include "answers.h" // answer_accepted
#include "board_facts.h" // limits of the board
#include "kept.h" // KEPT_MOST
#include "refusals.h" // refused_while_busy
#include "send_messages.h" // send_settings

// Refuse a command with invalid values. True if all are valid.
static bool valid(const struct command_frame *frame, const struct configure *request)
{
    if (request->trace > TRACE_KIND_CARRIER)
        answer_out_of_range(frame, FLASH_TEXT("trace: expected 0, 1 or 2"));
    else if (request->trace_bits != 0 && request->trace_bits != 8 && request->trace_bits != 16)
        answer_out_of_range(frame, FLASH_TEXT("trace_bits: expected 0, 8 or 16"));
    else if (request->echoes < 1 || request->echoes > MAX_ECHOES)
        answer_out_of_range(frame, FLASH_TEXT("echoes: expected 1 to 122"));
    else if (!request->listen_us)
        answer_out_of_range(frame, FLASH_TEXT("listen_us is 0; expected a time after blanking_us"));
    else if (!request->speed_of_sound)
        answer_out_of_range(frame, FLASH_TEXT("speed_of_sound is 0; expected mm/s above 0"));
    else
        return true;
    return false;
}

static uint32_t within(uint32_t least, uint32_t value, uint32_t most)
{
    return value < least ? least : value > most ? most : value;
}

// The nearest settings that this board supports.
static struct configure feasible(struct configure request)
{
    request.listen_us = within(0, request.listen_us, LISTEN_MOST_US);
    request.blanking_us = within(BLANKING_LEAST_US, request.blanking_us, BLANKING_MOST_US);
    request.rearm_us = (uint16_t)within(REARM_LEAST_US, request.rearm_us, REARM_MOST_US);
    request.pulses = PULSES_SENT;
    request.trace = request.trace ? TRACE_KIND : TRACE_KIND_NONE;
    request.trace_rate = request.trace ? TRACE_RATE : 0;
    request.trace_bits = request.trace ? 8 : 0;
    request.echoes = (uint8_t)within(1, request.echoes, request.trace ? ECHOES_BESIDE_TRACE : ECHOES_MOST);
    return request;
}

void on_configure(const struct command_frame *frame, const struct configure *request)
{
    if (refused_while_busy(frame) || !valid(frame, request))
        return;
    struct configure can = feasible(*request);
    if (can.listen_us <= can.blanking_us) {
        struct words words = {.size = 0};
        words_add(&words, FLASH_TEXT("blanking_us is "));
        words_number(&words, can.blanking_us);
        words_add(&words, FLASH_TEXT("; expected less than the listening time, "));
        words_number(&words, can.listen_us);
        words_add(&words, FLASH_TEXT(" us"));
        answer_refused_in_words(frame, REFUSAL_OUT_OF_RANGE, &words);
        return;
    }
    ping_settings = can;
    send_settings(&(struct settings){
        .command = frame->sequence,
        .listen_us = can.listen_us,
        .blanking_us = can.blanking_us,
        .trace = can.trace,
        .speed_of_sound = can.speed_of_sound,
        .pulses = can.pulses,
        .echoes = can.echoes,
        .rearm_us = can.rearm_us,
        .trace_rate = can.trace_rate,
        .trace_bits = can.trace_bits,
    });
}

static void refuse_number(const struct command_frame *frame, const char *flash_name, uint32_t number, uint64_t most)
{
    struct words words = {.size = 0};
    words_add(&words, flash_name);
    words_number(&words, number);
    words_add(&words, FLASH_TEXT("; expected 0 to "));
    words_number(&words, (int64_t)most);
    answer_refused_in_words(frame, REFUSAL_OUT_OF_RANGE, &words);
}

void on_start_scan(const struct command_frame *frame, const struct start_scan *order)
{
    if (refused_while_busy(frame))
        return;
    if (!order->step || !order->headings || !order->sweeps || !order->pings)
        answer_out_of_range(frame, FLASH_TEXT("step, headings, sweeps and pings must not be 0"));
    else if (order->in_place > 1 || (order->in_place && order->headings > 1))
        answer_out_of_range(frame, FLASH_TEXT("in_place: expected 0, or 1 with one heading"));
    else if (!order->in_place && (refused_angle(frame, order->start) || refused_angle(frame, scan_end(order))))
        return;
    else if (scan_readings(order) > MOST_READINGS)
        answer_out_of_range(frame, FLASH_TEXT("too many readings; expected at most 4294967295"));
    else if (order->first >= scan_readings(order))
        refuse_number(frame, FLASH_TEXT("first is "), order->first, scan_readings(order) - 1);
    else if (!scan_count(order))
        refuse_number(frame, FLASH_TEXT("count is "), order->count, scan_readings(order) - order->first);
    else
        action_scan(frame, order);
}

void on_stop(const struct command_frame *frame)
{
    action_stop();
    answer_accepted(frame);
}

void on_resend(const struct command_frame *frame, const struct resend *request)
{
    if (request->count < 1 || request->count > KEPT_MOST) {
        answer_out_of_range(frame, FLASH_TEXT("count: expected 1 to 64 readings"));
        return;
    }
    answer_accepted(frame);
    action_send_again(request->first, request->count);
}
