/* Written by generate.py; change that, not this. */

#ifndef MESSAGES_H
#define MESSAGES_H

#include "fields.h" // struct text

#define NO_TEMPERATURE -32768
#define PROTOCOL_MAJOR 1
#define PROTOCOL_MINOR 1
#define FIRST_BAUD 250000
#define MAX_PAYLOAD 512
#define MAX_ECHOES 122
#define MAX_TEXT 60
#define MAX_TEST 64
#define MAX_TESTED 480
#define CHUNK 256
#define MOST_READINGS 4294967295u
#define KEPT_READINGS 64
#define HEARTBEAT_US 250000
#define HOST_SILENCE_US 2000000
#define UNHEARD_US 500000

enum message_type {
    HELLO = 0x01,
    CONFIGURE = 0x02,
    HOME = 0x03,
    TURN = 0x04,
    START_SCAN = 0x05,
    STOP = 0x06,
    RESEND = 0x07,
    ASK_CAPABILITIES = 0x08,
    CONFIGURE_TURNTABLE = 0x09,
    ASK_STATISTICS = 0x0a,
    SET_BAUD = 0x0b,
    TEST_LINK = 0x0c,
    INFO = 0x81,
    ACCEPTED = 0x82,
    REFUSED = 0x83,
    SETTINGS = 0x84,
    STARTED = 0x85,
    FINISHED = 0x86,
    READING_MESSAGE = 0x87,
    TRACE_CHUNK = 0x88,
    HEARTBEAT = 0x89,
    CAPABILITIES = 0x8a,
    TURNTABLE_SETTINGS = 0x8b,
    STATISTICS = 0x8c,
    LINK_TESTED = 0x8d,
};

enum state {
    STATE_IDLE = 0,
    STATE_HOMING = 1,
    STATE_TURNING = 2,
    STATE_SCANNING = 3,
};

enum outcome {
    OUTCOME_DONE = 0,
    OUTCOME_STOPPED = 1,
    OUTCOME_FAULT = 2,
    OUTCOME_LOST_STEPS = 3,
};

enum refusal {
    REFUSAL_UNKNOWN = 1,
    REFUSAL_MALFORMED = 2,
    REFUSAL_OUT_OF_RANGE = 3,
    REFUSAL_BUSY = 4,
    REFUSAL_NOT_HOMED = 5,
    REFUSAL_NO_HELLO = 6,
};

enum trace_kind {
    TRACE_KIND_NONE = 0,
    TRACE_KIND_ENVELOPE = 1,
    TRACE_KIND_CARRIER = 2,
};

enum approach {
    APPROACH_EITHER = 0,
    APPROACH_COUNTER_CLOCKWISE = 1,
    APPROACH_CLOCKWISE = 2,
};

enum reset_cause {
    RESET_CAUSE_UNKNOWN = 0,
    RESET_CAUSE_POWER = 1,
    RESET_CAUSE_BUTTON = 2,
    RESET_CAUSE_BROWNOUT = 3,
    RESET_CAUSE_WATCHDOG = 4,
    RESET_CAUSE_SOFTWARE = 5,
};

enum feature {
    FEATURE_HOME_MARK = 1,
    FEATURE_LOST_STEPS = 2,
    FEATURE_THERMOMETER = 4,
    FEATURE_BLANKING = 8,
    FEATURE_REARM = 16,
    FEATURE_PULSES = 32,
    FEATURE_ENVELOPE = 64,
    FEATURE_CARRIER = 128,
};

struct hello {
    uint8_t major; // protocol version the host speaks
    uint8_t minor; // protocol version the host speaks
};

struct configure {
    uint32_t listen_us; // how long to listen after the start of transmission, µs
    uint32_t blanking_us; // no echo counts before this time, µs
    uint8_t trace; // trace code: what to send of every ping besides its echo times
    uint32_t speed_of_sound; // mm/s; kept and returned, so that a log alone gives ranges
    uint8_t pulses; // cycles to transmit; 0: the board's own · 1.1, else 0
    uint8_t echoes; // how many echoes of a ping to report at most, 1 to 122 · 1.1, else 122
    uint16_t rearm_us; // from an echo until the board hears again, µs; 0: as soon as it can · 1.1, else 0
    uint32_t trace_rate; // samples per second, Hz; 0: the device's own · 1.1, else 0
    uint8_t trace_bits; // bits of a sample, 8 or 16; 0: the device's own · 1.1, else 0
};

struct turn {
    int32_t angle; // turntable angle, µdeg, counter-clockwise
};

struct start_scan {
    int32_t start; // first turntable angle, µdeg
    int32_t step; // from one heading to the next, µdeg, not 0
    uint16_t headings; // headings of one sweep, at least 1
    uint16_t sweeps; // sweeps, at least 1; every second one runs backwards
    uint8_t pings; // pings at each heading, at least 1
    uint32_t first; // number of the first reading to make; those before it are left out · 1.1, else 0
    uint32_t count; // how many readings to make; 0: all from the first on · 1.1, else 0
};

struct resend {
    uint32_t first; // number of the first reading wanted
    uint8_t count; // how many, 1 to 64
};

struct configure_turntable {
    uint32_t speed; // µdeg/s; 0: the device's own
    uint32_t acceleration; // µdeg/s²; 0: the device's own
    uint32_t settle_us; // from standing still to the next ping, µs
    uint8_t approach; // approach code: from which side to come to an angle, against backlash
};

struct set_baud {
    uint32_t baud; // bits per second
};

struct test_link {
    uint16_t size; // how many bytes to send back, at most 480
    struct samples data; // 1 to 64 bytes
};

struct info {
    uint16_t command; // sequence number of the Hello answered
    uint8_t major; // protocol version the device speaks
    uint8_t minor; // protocol version the device speaks
    struct text firmware; // name and version of the firmware
    struct text serial; // serial number
    struct text board; // board profile that describes it, empty if unknown
    int16_t temperature; // air at the board, 0.01 °C; −32768: no thermometer
    uint32_t trace_rate; // samples per second of a trace, Hz; 0: no traces
    uint32_t microsteps; // microsteps in a whole turn
    uint32_t boot; // how often the device has started; 0: not counted · 1.1, else 0
    uint8_t homed; // 1: the turntable knows its zero, 0: it does not · 1.1, else 0
};

struct accepted {
    uint16_t command; // sequence number of the command
};

struct refused {
    uint16_t command; // sequence number of the command
    uint8_t code; // refusal code
    struct text text; // the reason for a person to read
};

struct settings {
    uint16_t command; // sequence number of the Configure answered
    uint32_t listen_us; // as in Configure
    uint32_t blanking_us; // as in Configure
    uint8_t trace; // as in Configure
    uint32_t speed_of_sound; // as in Configure
    uint8_t pulses; // as in Configure, but never 0 where the device knows · 1.1, else 0
    uint8_t echoes; // as in Configure · 1.1, else 122
    uint16_t rearm_us; // as in Configure · 1.1, else 0
    uint32_t trace_rate; // as in Configure, but never 0 where traces are sent · 1.1, else 0
    uint8_t trace_bits; // as in Configure, but never 0 where traces are sent · 1.1, else 0
};

struct started {
    uint16_t command; // sequence number of the StartScan answered
    uint32_t readings; // how many readings will come
    uint32_t first; // number of the first one · 1.1, else 0
};

struct finished {
    uint16_t command; // sequence number of the command that ended
    uint8_t outcome; // outcome code
    uint32_t readings; // the number that the next reading would have had; 0 but for a scan
    struct text text; // what went wrong, empty where nothing did
};

struct reading_message {
    uint32_t number; // counts from 0 within the scan
    uint16_t sweep; // counts from 0
    uint8_t ping; // counts from 0 at each heading
    int32_t angle; // turntable angle, µdeg
    uint64_t fired_us; // device clock at the start of transmission, µs
    int16_t temperature; // air at the board, 0.01 °C; −32768: no thermometer
    struct numbers echoes; // times of flight from the start of transmission, ns, earliest first
};

struct trace_chunk {
    uint32_t number; // reading it belongs to
    uint16_t offset; // index of its first sample in the trace
    uint16_t total; // samples in the whole trace
    uint32_t period_ns; // from one sample to the next, ns
    uint32_t start_ns; // from the start of transmission to sample 0, ns
    struct samples samples; // at most 256 bytes a chunk; samples of 16 bits are little-endian
    uint8_t kind; // trace code: 1 the envelope, 2 the carrier, which rests at half of full scale · 1.1, else 1
    uint8_t bits; // bits of a sample, 8 or 16; all of them set is full scale · 1.1, else 8
};

struct heartbeat {
    uint8_t state; // state code
    int32_t angle; // turntable angle, µdeg
    uint32_t readings; // the number that the next reading of this or the last scan would have
    int16_t temperature; // air at the board, 0.01 °C; −32768: no thermometer
    uint32_t boot; // as in Info: another number than there tells of a reset · 1.1, else 0
    uint8_t homed; // as in Info · 1.1, else 0
};

struct capabilities {
    uint16_t command; // sequence number of the command
    uint32_t features; // sum of the feature codes that hold
    int32_t lowest_angle; // how far the cable lets it turn clockwise, µdeg
    int32_t highest_angle; // how far the cable lets it turn counter-clockwise, µdeg
    uint16_t steps; // full steps of the motor in a whole turn of the table; 0: not known
    uint32_t fastest; // highest speed, µdeg/s
    uint32_t hardest; // highest acceleration, µdeg/s²; 0: not known
    uint32_t backlash; // play of the gear, µdeg; 0: none or not known
    uint32_t longest_listen_us; // how long it can listen, µs
    uint32_t shortest_blanking_us; // µs
    uint16_t shortest_rearm_us; // µs
    uint8_t most_pulses; // cycles it can transmit; 0: not known
    uint8_t most_echoes; // echoes it can report of one ping
    uint32_t ping_period_us; // from the start of one ping to the next, at least, µs
    uint32_t fastest_trace; // Hz; 0: no traces
    uint16_t longest_trace; // samples
    uint32_t fastest_baud; // highest speed of its line; 0: the line has none of its own (TCP, USB CDC)
    uint16_t readings_kept; // how many readings it keeps to send again
};

struct turntable_settings {
    uint16_t command; // sequence number of the command
    uint32_t speed; // µdeg/s, never 0
    uint32_t acceleration; // µdeg/s²; 0: not known
    uint32_t settle_us; // as in ConfigureTurntable
    uint8_t approach; // as in ConfigureTurntable
};

struct statistics {
    uint16_t command; // sequence number of the command
    uint32_t frames; // sound frames that came from the host
    uint32_t rejected; // blocks between two zeros that were no frame
    uint32_t overruns; // bytes that came faster than they were taken
    uint32_t pings; // pings made
    int32_t lost_steps; // microsteps found missing at the zero mark, all together
    uint8_t reset_cause; // reset code: why it started last
    uint16_t stack_free; // bytes of the stack never used; 0: not measured
};

struct link_tested {
    uint16_t command; // sequence number of the command
    struct samples data; // those of the TestLink over and over, as many as it asked for
};

#endif
