#include "commands.h"

#include "action.h" // home, turn, scan
#include "board_facts.h" // what the board can
#include "conversation.h" // conversation_greeted
#include "hardware.h" // thermometer
#include "kept.h" // ECHOES_MOST
#include "line.h" // line_can
#include "turntable.h" // turntable
#include "voice.h" // answers

#define MICRODEGREES_A_STEP (360000000L / MICROSTEPS)

static void greet(const struct command_frame *frame, const struct hello *hello)
{
    action_stop();
    action_forget();
    action_send_again(0, 0);
    conversation_greeted(hello);
    say_info(&(struct info){
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
        .homed = turntable_homed(),
    });
}

static bool out_of_range(const struct command_frame *frame, const char *flash_text)
{
    say_refused_plainly(frame->sequence, REFUSAL_OUT_OF_RANGE, flash_text);
    return false;
}

static bool makes_sense(const struct command_frame *frame, const struct configure *wish)
{
    if (wish->trace > TRACE_KIND_CARRIER)
        return out_of_range(frame, FLASH_TEXT("trace is 0, 1 or 2"));
    if (wish->trace_bits != 0 && wish->trace_bits != 8 && wish->trace_bits != 16)
        return out_of_range(frame, FLASH_TEXT("traces have 8 or 16 bits; 0 is the board's own"));
    if (wish->echoes < 1 || wish->echoes > MAX_ECHOES)
        return out_of_range(frame, FLASH_TEXT("1 to 122 echoes of a ping"));
    if (!wish->listen_us)
        return out_of_range(frame, FLASH_TEXT("listen is 0 us; nothing would be heard"));
    if (!wish->speed_of_sound)
        return out_of_range(frame, FLASH_TEXT("speed of sound is 0 mm/s"));
    return true;
}

// The nearest that this board can.
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

static void configure(const struct command_frame *frame, const struct configure *wish)
{
    if (!makes_sense(frame, wish))
        return;
    struct configure can = feasible(*wish);
    if (can.listen_us <= can.blanking_us) {
        struct words words = {.size = 0};
        words_add(&words, FLASH_TEXT("nothing is heard with "));
        words_number(&words, can.blanking_us);
        words_add(&words, FLASH_TEXT(" us of blanking in "));
        words_number(&words, can.listen_us);
        words_add(&words, FLASH_TEXT(" us of listening"));
        say_refused(frame->sequence, REFUSAL_OUT_OF_RANGE, &words);
        return;
    }
    ping_settings = can;
    say_settings(&(struct settings){
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

// Whether the cable lets it point there, and where there is known; refuses where not.
static bool can_point(const struct command_frame *frame, int64_t microdegrees)
{
    if (!turntable_homed()) {
        say_refused_plainly(frame->sequence, REFUSAL_NOT_HOMED,
                            FLASH_TEXT("the turntable does not know its angle; send Home first"));
        return false;
    }
    if (turntable_reaches(microdegrees))
        return true;
    struct words words = {.size = 0};
    words_degrees(&words, microdegrees);
    words_add(&words, FLASH_TEXT(" degrees; the cable winds from "));
    words_number(&words, -REACH_DEGREES);
    words_add(&words, FLASH_TEXT(" to "));
    words_number(&words, REACH_DEGREES);
    words_add(&words, FLASH_TEXT(" degrees"));
    say_refused(frame->sequence, REFUSAL_OUT_OF_RANGE, &words);
    return false;
}

static void start_scan(const struct command_frame *frame, const struct start_scan *order)
{
    if (!order->step || !order->headings || !order->sweeps || !order->pings)
        out_of_range(frame, FLASH_TEXT("step, headings, sweeps and pings are not 0"));
    else if (!can_point(frame, order->start) || !can_point(frame, scan_end(order)))
        return;
    else if (!scan_count(order))
        out_of_range(frame, FLASH_TEXT("not that many readings; a scan has at most 4294967295"));
    else
        action_scan(frame, order);
}

static void send_again(const struct command_frame *frame, const struct resend *wish)
{
    if (wish->count < 1 || wish->count > KEPT_MOST) {
        out_of_range(frame, FLASH_TEXT("1 to 64 readings can be sent again"));
        return;
    }
    say_accepted(frame->sequence);
    action_send_again(wish->first, wish->count);
}

static void tell_capabilities(const struct command_frame *frame)
{
    say_capabilities(&(struct capabilities){
        .command = frame->sequence,
        .features = FEATURE_HOME_MARK | FEATURE_LOST_STEPS | FEATURE_BLANKING | FEATURE_REARM |
                    (thermometer() == NO_TEMPERATURE ? 0 : FEATURE_THERMOMETER) |
                    (TRACE_KIND == TRACE_KIND_CARRIER ? FEATURE_CARRIER : FEATURE_ENVELOPE),
        .lowest_angle = -REACH_DEGREES * 1000000L,
        .highest_angle = REACH_DEGREES * 1000000L,
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
        .readings_kept = kept_promised(ping_settings.echoes),
    });
}

static uint32_t steps_of(uint32_t microdegrees)
{
    return microdegrees ? 1 + (microdegrees - 1) / MICRODEGREES_A_STEP : 0;
}

static void configure_turntable(const struct command_frame *frame, const struct configure_turntable *wish)
{
    if (wish->approach > APPROACH_CLOCKWISE) {
        out_of_range(frame, FLASH_TEXT("approach is 0, 1 or 2"));
        return;
    }
    uint32_t speed = steps_of(wish->speed);
    turntable_set_manner((struct turntable_manner){
        .speed = speed < SPEED ? (uint16_t)speed : SPEED,
        .acceleration = steps_of(wish->acceleration),
        .settle_us = wish->settle_us,
        .approach = wish->approach,
    });
    struct turntable_manner manner = turntable_manner();
    say_turntable_settings(&(struct turntable_settings){
        .command = frame->sequence,
        .speed = manner.speed * (uint32_t)MICRODEGREES_A_STEP,
        .acceleration = manner.acceleration * MICRODEGREES_A_STEP,
        .settle_us = manner.settle_us,
        .approach = manner.approach,
    });
}

static void tell_statistics(const struct command_frame *frame, const struct receiver *receiver)
{
    say_statistics(&(struct statistics){
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

static void set_baud(const struct command_frame *frame, uint32_t baud)
{
    if (!line_can(baud)) {
        out_of_range(frame, FLASH_TEXT("the line can run at 250000, 500000 or 1000000 baud"));
        return;
    }
    say_accepted(frame->sequence);
    conversation_change_baud(baud);
}

static void test_link(const struct command_frame *frame, const struct test_link *wish)
{
    if (!wish->data.count || wish->data.count > MAX_TEST || wish->size > MAX_TESTED) {
        out_of_range(frame, FLASH_TEXT("1 to 64 bytes, to come back as at most 480"));
        return;
    }
    say_link_tested(&(struct link_tested){
        .command = frame->sequence,
        .data = {.bytes = wish->data.bytes, .count = wish->size, .period = wish->data.count},
    });
}

union command {
    struct hello hello;
    struct configure configure;
    struct turn turn;
    struct start_scan start_scan;
    struct resend resend;
    struct configure_turntable configure_turntable;
    struct set_baud set_baud;
    struct test_link test_link;
};

enum understood { SOUND, CUT_OFF, UNHEARD_OF };

static enum understood understand(const struct command_frame *frame, union command *command)
{
    struct payload payload = payload_of((uint8_t *)frame->payload, frame->size);
    bool whole = true;
    switch (frame->type) {
    case HELLO:
        whole = hello_unpack(&command->hello, &payload);
        break;
    case CONFIGURE:
        whole = configure_unpack(&command->configure, &payload);
        break;
    case TURN:
        whole = turn_unpack(&command->turn, &payload);
        break;
    case START_SCAN:
        whole = start_scan_unpack(&command->start_scan, &payload);
        break;
    case RESEND:
        whole = resend_unpack(&command->resend, &payload);
        break;
    case CONFIGURE_TURNTABLE:
        whole = configure_turntable_unpack(&command->configure_turntable, &payload);
        break;
    case SET_BAUD:
        whole = set_baud_unpack(&command->set_baud, &payload);
        break;
    case TEST_LINK:
        whole = test_link_unpack(&command->test_link, &payload);
        break;
    case HOME:
    case STOP:
    case ASK_CAPABILITIES:
    case ASK_STATISTICS:
        break;
    default:
        return UNHEARD_OF;
    }
    return whole ? SOUND : CUT_OFF;
}

static bool needs_rest(uint8_t type)
{
    return type == CONFIGURE || type == HOME || type == TURN || type == START_SCAN || type == CONFIGURE_TURNTABLE ||
           type == SET_BAUD;
}

// Whether the command can be carried out now; refuses it where not.
static bool admitted(const struct command_frame *frame, enum understood understood, bool greeted)
{
    if (understood == UNHEARD_OF) {
        struct words words = {.size = 0};
        words_add(&words, FLASH_TEXT("message type 0x"));
        words_hex(&words, frame->type);
        words_add(&words, FLASH_TEXT(" is not known to this firmware"));
        say_refused(frame->sequence, REFUSAL_UNKNOWN, &words);
    } else if (understood == CUT_OFF) {
        say_refused_plainly(frame->sequence, REFUSAL_MALFORMED, FLASH_TEXT("the payload ends too soon"));
    } else if (!greeted && frame->type != HELLO) {
        say_refused_plainly(frame->sequence, REFUSAL_NO_HELLO, FLASH_TEXT("say Hello first"));
    } else if (action_running() && needs_rest(frame->type)) {
        say_refused_plainly(frame->sequence, REFUSAL_BUSY, FLASH_TEXT("homes, turns or scans; send Stop first"));
    } else {
        return true;
    }
    return false;
}

void obey(const struct command_frame *frame, const struct receiver *receiver, bool greeted)
{
    union command command;
    if (greeted && action_is(frame)) {
        action_repeat();
        return;
    }
    if (!admitted(frame, understand(frame, &command), greeted))
        return;
    switch (frame->type) {
    case HELLO:
        greet(frame, &command.hello);
        break;
    case CONFIGURE:
        configure(frame, &command.configure);
        break;
    case HOME:
        action_home(frame);
        break;
    case TURN:
        if (can_point(frame, command.turn.angle))
            action_turn(frame, command.turn.angle);
        break;
    case START_SCAN:
        start_scan(frame, &command.start_scan);
        break;
    case STOP:
        action_stop();
        say_accepted(frame->sequence);
        break;
    case RESEND:
        send_again(frame, &command.resend);
        break;
    case ASK_CAPABILITIES:
        tell_capabilities(frame);
        break;
    case CONFIGURE_TURNTABLE:
        configure_turntable(frame, &command.configure_turntable);
        break;
    case ASK_STATISTICS:
        tell_statistics(frame, receiver);
        break;
    case SET_BAUD:
        set_baud(frame, command.set_baud.baud);
        break;
    case TEST_LINK:
        test_link(frame, &command.test_link);
        break;
    }
}
