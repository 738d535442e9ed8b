/* Commands of a scan: Configure, StartScan, Stop, Resend. */
#include "commands.h"

#include "action.h" // action_scan
#include "answers.h" // answer_accepted
#include "board_facts.h" // what the board can do
#include "kept.h" // ECHOES_MOST
#include "refusals.h" // refused_while_busy
#include "send_messages.h" // send_settings

// Refuse a command whose values have no meaning; true if they have.
static bool sensible(const struct command_frame *frame, const struct configure *wish)
{
    if (wish->trace > TRACE_KIND_CARRIER)
        answer_out_of_range(frame, FLASH_TEXT("trace is 0, 1 or 2"));
    else if (wish->trace_bits != 0 && wish->trace_bits != 8 && wish->trace_bits != 16)
        answer_out_of_range(frame, FLASH_TEXT("traces have 8 or 16 bits; 0 is the board's own"));
    else if (wish->echoes < 1 || wish->echoes > MAX_ECHOES)
        answer_out_of_range(frame, FLASH_TEXT("1 to 122 echoes of a ping"));
    else if (!wish->listen_us)
        answer_out_of_range(frame, FLASH_TEXT("listen is 0 us; nothing would be heard"));
    else if (!wish->speed_of_sound)
        answer_out_of_range(frame, FLASH_TEXT("speed of sound is 0 mm/s"));
    else
        return true;
    return false;
}

// The nearest settings that this board can do.
static struct configure feasible(struct configure wish)
{
    if (wish.listen_us > LISTEN_MOST_US)
        wish.listen_us = LISTEN_MOST_US;
    if (wish.blanking_us < BLANKING_LEAST_US)
        wish.blanking_us = BLANKING_LEAST_US;
    if (wish.rearm_us < REARM_LEAST_US)
        wish.rearm_us = REARM_LEAST_US;
    wish.pulses = PULSES_SENT;
    wish.trace = wish.trace ? TRACE_KIND : TRACE_KIND_NONE;
    wish.trace_rate = wish.trace ? TRACE_RATE : 0;
    wish.trace_bits = wish.trace ? 8 : 0;
    uint8_t most = wish.trace ? ECHOES_BESIDE_TRACE : ECHOES_MOST;
    if (wish.echoes > most)
        wish.echoes = most;
    return wish;
}

void on_configure(const struct command_frame *frame, const struct configure *wish)
{
    if (refused_while_busy(frame) || !sensible(frame, wish))
        return;
    struct configure can = feasible(*wish);
    if (can.listen_us <= can.blanking_us) {
        struct words words = {.size = 0};
        words_add(&words, FLASH_TEXT("nothing is heard with "));
        words_number(&words, can.blanking_us);
        words_add(&words, FLASH_TEXT(" us of blanking in "));
        words_number(&words, can.listen_us);
        words_add(&words, FLASH_TEXT(" us of listening"));
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

void on_start_scan(const struct command_frame *frame, const struct start_scan *order)
{
    if (refused_while_busy(frame))
        return;
    if (!order->step || !order->headings || !order->sweeps || !order->pings)
        answer_out_of_range(frame, FLASH_TEXT("step, headings, sweeps and pings are not 0"));
    else if (refused_angle(frame, order->start) || refused_angle(frame, scan_end(order)))
        return;
    else if (!scan_count(order))
        answer_out_of_range(frame, FLASH_TEXT("not that many readings; a scan has at most 4294967295"));
    else
        action_scan(frame, order);
}

void on_stop(const struct command_frame *frame)
{
    action_stop();
    answer_accepted(frame);
}

void on_resend(const struct command_frame *frame, const struct resend *wish)
{
    if (wish->count < 1 || wish->count > KEPT_MOST) {
        answer_out_of_range(frame, FLASH_TEXT("1 to 64 readings can be sent again"));
        return;
    }
    answer_accepted(frame);
    action_send_again(wish->first, wish->count);
}
