#include "action.h"

#include <string.h> // memcmp

#include "angles.h" // nearest_step
#include "board_facts.h" // PING_PERIOD_US
#include "hardware.h" // pings
#include "kept.h" // readings
#include "line.h" // line_quiet
#include "outbox.h" // outbox_idle
#include "send_messages.h" // send_reading_message
#include "turntable.h" // turntable
#include "wiring.h" // one_switch
#include "words.h" // struct words

#define PATIENCE_US 100000 // answers may delay a ping by this
#define KEY_MOST 24 // bytes of a payload compared to recognize a repeated command; commands of version 1.2 are shorter

enum phase { AIMING, TURNING_THERE, READY, LISTENING, SENDING_TRACE };

struct configure ping_settings;
struct place ping_place;

// the running Home, Turn or StartScan, or the last one
static struct {
    uint8_t type; // 0: none
    bool running;
    uint16_t sequence;
    uint8_t key[KEY_MOST];
    uint8_t size; // of its payload
    enum outcome outcome;
    enum turntable_trouble trouble;
    uint32_t next; // number of the next reading, for Finished
} action;

static struct {
    struct start_scan order;
    uint32_t end; // number after the last reading
    enum phase phase;
    uint64_t next_ping;
} scan;

static struct {
    uint32_t number;
    const uint8_t *samples;
    uint16_t sent, total;
    uint8_t *const *lost; // those of the samples not yet sent that were not measured
    uint8_t lost_count;
} trace;

static struct {
    uint32_t next, end;
} again;

static uint32_t pings;

void action_reset(void)
{
    action.type = 0;
    action.running = false;
    trace.sent = trace.total = 0;
    again.next = again.end = 0;
    scan.next_ping = 0;
    pings = 0;
    kept_clear(0);
    ping_settings = (struct configure){
        .listen_us = LISTEN_MOST_US,
        .blanking_us = BLANKING_US,
        .speed_of_sound = 343200,
        .pulses = PULSES_SENT,
        .echoes = ECHOES_BESIDE_TRACE,
        .rearm_us = REARM_LEAST_US,
    };
}

bool action_running(void) { return action.running; }

enum state action_state(void)
{
    return !action.running         ? STATE_IDLE
           : action.type == HOME   ? STATE_HOMING
           : action.type == TURN   ? STATE_TURNING
                                   : STATE_SCANNING;
}

bool action_listening(void) { return action_state() == STATE_SCANNING && scan.phase == LISTENING; }

uint32_t action_pings(void) { return pings; }

/* The remembered command. */

static uint8_t key_size(const struct command_frame *order) { return order->size < KEY_MOST ? order->size : KEY_MOST; }

bool action_is(const struct command_frame *order)
{
    return action.type && order->type == action.type && order->sequence == action.sequence &&
           order->size == action.size && !memcmp(order->payload, action.key, key_size(order));
}

void action_forget(void) { action.type = 0; }

static void answer_begun(void)
{
    if (action.type == START_SCAN)
        send_started(&(struct started){action.sequence, scan_count(&scan.order), scan.order.first});
    else
        send_accepted(&(struct accepted){action.sequence});
}

static void add_trouble(struct words *words)
{
    switch (action.trouble) {
    case TROUBLE_NO_MARK:
        words_add(words, FLASH_TEXT("the zero mark never came; check its wire and the motor"));
        break;
    case TROUBLE_CAM:
        words_add(words, FLASH_TEXT("the cam never changed; check its wire and polarity, and the direction"));
        break;
    case TROUBLE_WRONG_WAY:
        words_add(words, one_switch() ? FLASH_TEXT("moved the wrong way; invert the mark or the motor")
                                      : FLASH_TEXT("moved the wrong way; invert the mark, or cam and motor"));
        break;
    case TROUBLE_LIMIT:
        words_add(words, FLASH_TEXT("homing may wind the cable no further; unwind it by hand and restart the board"));
        break;
    case TROUBLE_LOST_STEPS:
        words_add(words, FLASH_TEXT("the zero mark is out of place: steps were lost; send Home"));
        break;
    case TROUBLE_NONE:
        return;
    }
    if (one_switch() && action.trouble != TROUBLE_LIMIT)
        words_add(words, FLASH_TEXT("; begin within 45 degrees of 0"));
    if (action.type != HOME)
        return;
    words_add(words, FLASH_TEXT("; mark "));
    words_number(words, home_mark());
    if (!one_switch()) {
        words_add(words, FLASH_TEXT(", cam "));
        words_number(words, home_side());
    }
}

static void answer_ended(void)
{
    struct words words = {.size = 0};
    add_trouble(&words);
    send_finished(&(struct finished){
        .command = action.sequence,
        .outcome = action.outcome,
        .readings = action.type == START_SCAN ? action.next : 0,
        .text = words_text(&words),
    });
}

void action_repeat(void)
{
    answer_begun();
    if (!action.running)
        answer_ended();
}

/* Begin and end. */

static void begin(const struct command_frame *order)
{
    action.type = order->type;
    action.running = true;
    action.sequence = order->sequence;
    action.size = order->size;
    memcpy(action.key, order->payload, key_size(order));
    action.trouble = TROUBLE_NONE;
    answer_begun();
}

static void end(enum outcome outcome)
{
    action.running = false;
    action.outcome = outcome;
    action.trouble = turntable_trouble();
    action.next = kept_end();
    answer_ended();
}

void action_home(const struct command_frame *order)
{
    turntable_home();
    begin(order);
}

void action_turn(const struct command_frame *order, int32_t microdegrees)
{
    turntable_turn(microdegrees);
    begin(order);
}

void action_jog(const struct command_frame *order, int32_t microdegrees)
{
    turntable_jog(microdegrees);
    begin(order);
}

void action_scan(const struct command_frame *order, const struct start_scan *wanted)
{
    kept_clear(wanted->first);
    again.next = again.end;
    trace.sent = trace.total;
    scan.order = *wanted;
    scan.end = wanted->first + scan_count(wanted);
    scan.phase = AIMING;
    if (wanted->in_place)
        turntable_stay();
    begin(order);
}

void action_stop(void)
{
    if (!action.running)
        return;
    trace.sent = trace.total;
    turntable_halt();
    end(OUTCOME_STOPPED);
}

/* Readings and traces. */

static void send_kept(uint32_t number)
{
    struct reading reading;
    kept_get(number, &reading);
    struct place place = scan_place(&scan.order, number);
    for (uint8_t echo = 0; echo < reading.echo_count; echo++)
        reading.echoes[echo] *= 500; // ns
    send_reading_message(&(struct reading_message){
        .number = number,
        .sweep = place.sweep,
        .ping = place.ping,
        .angle = nearest_step(place.angle),
        .fired_us = reading.fired_us,
        .temperature = reading.temperature,
        .echoes = {reading.echoes, reading.echo_count},
    });
    outbox_finish(); // the echoes are on the stack
}

// Take the lost samples of the next `count` samples off the list, and return their indices in this chunk.
static struct samples lost_in_chunk(uint8_t *indices, uint16_t count)
{
    struct samples lost = {.bytes = indices};
    const uint8_t *first = trace.samples + trace.sent;
    for (; trace.lost_count && *trace.lost < first + count; trace.lost++, trace.lost_count--)
        indices[lost.count++] = (uint8_t)(*trace.lost - first);
    return lost;
}

static void send_chunk(void)
{
    uint16_t left = trace.total - trace.sent;
    uint16_t count = left < CHUNK ? left : CHUNK;
    uint8_t indices[LOST_MOST];
    struct trace_chunk chunk = {
        .number = trace.number,
        .offset = trace.sent,
        .total = trace.total,
        .period_ns = TRACE_PERIOD_NS,
        .start_ns = TRACE_START_NS,
        .samples = {.bytes = trace.samples + trace.sent, .count = count},
        .kind = TRACE_KIND,
        .bits = 8,
        .lost = lost_in_chunk(indices, count),
    };
    trace.sent += count;
    send_trace_chunk(&chunk);
}

// Move the valid echoes of a ping to the front. Returns their number.
static uint8_t sift(uint32_t *echoes, uint8_t count)
{
    uint8_t sifted = 0;
    for (uint8_t echo = 0; echo < count && sifted < ping_settings.echoes; echo++)
        if (echoes[echo] >= ping_settings.blanking_us * 2 && echoes[echo] <= ping_settings.listen_us * 2)
            echoes[sifted++] = echoes[echo];
    return sifted;
}

static void take_reading(void)
{
    struct ping_result result = ping_result();
    trace.number = kept_end();
    trace.samples = result.trace;
    trace.total = result.trace_size;
    trace.lost = result.lost;
    trace.lost_count = result.lost_count;
    trace.sent = 0;
    kept_add(result.fired_us, thermometer(), result.echoes, sift(result.echoes, result.echo_count));
    pings++;
    send_kept(trace.number);
    scan.next_ping = result.fired_us + PING_PERIOD_US;
    scan.phase = kept_end() != scan.end ? AIMING : SENDING_TRACE;
}

void action_send_again(uint32_t first, uint8_t count)
{
    uint64_t end = (uint64_t)first + count;
    again.next = first > kept_first() ? first : kept_first();
    again.end = end < kept_end() ? (uint32_t)end : kept_end();
    if (again.next > again.end)
        again.next = again.end;
}

bool action_send(void)
{
    if (again.next < again.end)
        send_kept(again.next++);
    else if (trace.sent < trace.total)
        send_chunk();
    else
        return false;
    return true;
}

/* Main loop. */

static bool ping_due(uint64_t now_us)
{
    bool all_sent = outbox_idle() && trace.sent == trace.total && again.next == again.end;
    return action_state() == STATE_SCANNING && scan.phase == READY && now_us >= scan.next_ping && all_sent;
}

bool action_needs_silence(uint64_t now_us) { return ping_due(now_us) && now_us >= scan.next_ping + PATIENCE_US; }

// Start a ping when nothing is left to send, so that the line is silent while listening.
static void fire_when_quiet(uint64_t now_us)
{
    if (!ping_due(now_us) || !line_quiet())
        return;
    ping_start(&(struct ping_order){
        .listen_us = ping_settings.listen_us,
        .blanking_us = ping_settings.blanking_us,
        .rearm_us = ping_settings.rearm_us,
        .echoes = ping_settings.echoes,
        .trace = ping_settings.trace != TRACE_KIND_NONE,
    });
    scan.phase = LISTENING;
}

static void work_on_scan(uint64_t now_us, bool turning)
{
    switch (scan.phase) {
    case AIMING:
        ping_place = scan_place(&scan.order, kept_end());
        if (!scan.order.in_place)
            turntable_turn(ping_place.angle);
        turning = turntable_work(now_us);
        scan.phase = TURNING_THERE;
        // fall through
    case TURNING_THERE:
        if (turning)
            break;
        scan.phase = READY;
        if (scan.order.in_place)
            scan.order.start = turntable_microdegrees();
        if (scan.next_ping < now_us)
            scan.next_ping = now_us;
        // fall through
    case READY:
        fire_when_quiet(now_us);
        break;
    case LISTENING:
        if (ping_over())
            take_reading();
        break;
    case SENDING_TRACE:
        if (trace.sent == trace.total && outbox_idle())
            end(OUTCOME_DONE);
        break;
    }
}

void action_work(uint64_t now_us)
{
    bool turning = turntable_work(now_us);
    if (!action.running)
        return;
    enum turntable_trouble trouble = turntable_trouble();
    if (trouble != TROUBLE_NONE && !turning && !action_listening())
        end(trouble == TROUBLE_LOST_STEPS ? OUTCOME_LOST_STEPS : OUTCOME_FAULT);
    else if (action.type == START_SCAN)
        work_on_scan(now_us, turning);
    else if (!turning)
        end(OUTCOME_DONE);
}
