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
#define BAUD_TIMEOUT_US 500000

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
    uint8_t major; // major protocol version of the host
    uint8_t minor; // minor protocol version of the host
};

struct configure {
    uint32_t listen_us; // how long to listen, from the start of transmission, µs
    uint32_t blanking_us; // echoes before this time are ignored, from the start of transmission, µs
    uint8_t trace; // trace code: what to send of each ping besides its echo times
    uint32_t speed_of_sound; // mm/s; stored and returned only, so that a log contains all that ranges need
    uint8_t pulses; // cycles to transmit; 0: the board's default · 1.1, else 0
    uint8_t echoes; // maximum number of echoes to report of a ping, 1 to 122 · 1.1, else 122
    uint16_t rearm_us; // time from an echo to re-arming the receiver, µs; 0: as short as possible · 1.1, else 0
    uint32_t trace_rate; // sample rate of traces, Hz; 0: the device's default · 1.1, else 0
    uint8_t trace_bits; // bits per sample of traces, 8 or 16; 0: the device's default · 1.1, else 0
};

struct turn {
    int32_t angle; // turntable angle, µdeg, counter-clockwise
};

struct start_scan {
    int32_t start; // first turntable angle, µdeg
    int32_t step; // angle from one heading to the next, µdeg; not 0
    uint16_t headings; // number of headings in a sweep, at least 1
    uint16_t sweeps; // number of sweeps, at least 1; every second sweep runs backwards
    uint8_t pings; // number of pings at each heading, at least 1
    uint32_t first; // number of the first reading to make; earlier readings are skipped · 1.1, else 0
    uint32_t count; // number of readings to make; 0: all from `first` to the end · 1.1, else 0
};

struct resend {
    uint32_t first; // number of the first reading to send
    uint8_t count; // number of readings to send, 1 to 64
};

struct configure_turntable {
    uint32_t speed; // highest speed, µdeg/s; 0: the device's default
    uint32_t acceleration; // acceleration, µdeg/s²; 0: the device's default
    uint32_t settle_us; // pause between the end of a movement and the next ping, µs
    uint8_t approach; // approach code: direction in which to approach an angle, against backlash
};

struct set_baud {
    uint32_t baud; // bits per second
};

struct test_link {
    uint16_t size; // number of bytes to send back, at most 480
    struct samples data; // pattern to repeat, 1 to 64 bytes
};

struct info {
    uint16_t command; // sequence number of the answered Hello
    uint8_t major; // major protocol version of the device
    uint8_t minor; // minor protocol version of the device
    struct text firmware; // name and version of the firmware
    struct text serial; // serial number
    struct text board; // name of the board profile that describes the device; empty if unknown
    int16_t temperature; // air temperature at the board, 0.01 °C; −32768: no thermometer
    uint32_t trace_rate; // sample rate of traces, Hz; 0: no traces
    uint32_t microsteps; // microsteps per turn of the table
    uint32_t boot; // how many times the device has started; 0: not counted · 1.1, else 0
    uint8_t homed; // 1: the zero of the turntable is known; 0: it is not · 1.1, else 0
};

struct accepted {
    uint16_t command; // sequence number of the answered command
};

struct refused {
    uint16_t command; // sequence number of the answered command
    uint8_t code; // refusal code
    struct text text; // the reason, as text for the user
};

struct settings {
    uint16_t command; // sequence number of the answered Configure
    uint32_t listen_us; // as in Configure
    uint32_t blanking_us; // as in Configure
    uint8_t trace; // as in Configure
    uint32_t speed_of_sound; // as in Configure
    uint8_t pulses; // as in Configure; 0 only if unknown · 1.1, else 0
    uint8_t echoes; // as in Configure · 1.1, else 122
    uint16_t rearm_us; // as in Configure · 1.1, else 0
    uint32_t trace_rate; // as in Configure; 0 only if no traces are sent · 1.1, else 0
    uint8_t trace_bits; // as in Configure; 0 only if no traces are sent · 1.1, else 0
};

struct started {
    uint16_t command; // sequence number of the answered StartScan
    uint32_t readings; // number of readings that will follow
    uint32_t first; // number of the first of them · 1.1, else 0
};

struct finished {
    uint16_t command; // sequence number of the command that has ended
    uint8_t outcome; // outcome code
    uint32_t readings; // scan: number of the first reading not made; otherwise 0
    struct text text; // reason of a failure, as text for the user; empty on success
};

struct reading_message {
    uint32_t number; // number of the reading in its scan, from 0
    uint16_t sweep; // number of the sweep, from 0
    uint8_t ping; // number of the ping at its heading, from 0
    int32_t angle; // turntable angle, µdeg
    uint64_t fired_us; // device clock at the start of transmission, µs
    int16_t temperature; // air temperature at the board, 0.01 °C; −32768: no thermometer
    struct numbers echoes; // times of flight from the start of transmission, ns, earliest first
};

struct trace_chunk {
    uint32_t number; // number of the reading
    uint16_t offset; // index of the chunk's first sample in the trace
    uint16_t total; // number of samples in the whole trace
    uint32_t period_ns; // sample period, ns
    uint32_t start_ns; // time from the start of transmission to sample 0, ns
    struct samples samples; // at most 256 bytes; 16-bit samples are little-endian
    uint8_t kind; // trace code: 1 envelope; 2 carrier, whose zero is half of full scale · 1.1, else 1
    uint8_t bits; // bits per sample, 8 or 16; full scale is all bits set · 1.1, else 8
};

struct heartbeat {
    uint8_t state; // state code
    int32_t angle; // turntable angle, µdeg
    uint32_t readings; // number of the next reading of this or the last scan
    int16_t temperature; // air temperature at the board, 0.01 °C; −32768: no thermometer
    uint32_t boot; // as in Info; a different number means that the device was reset · 1.1, else 0
    uint8_t homed; // as in Info · 1.1, else 0
};

struct capabilities {
    uint16_t command; // sequence number of the answered command
    uint32_t features; // sum of the codes of the supported features
    int32_t lowest_angle; // clockwise limit of the cable, µdeg
    int32_t highest_angle; // counter-clockwise limit of the cable, µdeg
    uint16_t steps; // full motor steps per turn of the table; 0: unknown
    uint32_t fastest; // highest speed, µdeg/s
    uint32_t hardest; // highest acceleration, µdeg/s²; 0: unknown
    uint32_t backlash; // backlash of the gear, µdeg; 0: none or unknown
    uint32_t longest_listen_us; // longest listening time, µs
    uint32_t shortest_blanking_us; // shortest blanking, µs
    uint16_t shortest_rearm_us; // shortest `rearm_us`, µs
    uint8_t most_pulses; // highest number of transmitted cycles; 0: unknown
    uint8_t most_echoes; // highest number of echoes in a reading
    uint32_t ping_period_us; // shortest time from the start of one ping to the start of the next, µs
    uint32_t fastest_trace; // highest sample rate of traces, Hz; 0: no traces
    uint16_t longest_trace; // highest number of samples in a trace
    uint32_t fastest_baud; // highest baud rate of the line; 0: the line has no baud rate (TCP, USB CDC)
    uint16_t readings_kept; // number of readings that the device keeps for Resend
};

struct turntable_settings {
    uint16_t command; // sequence number of the answered command
    uint32_t speed; // highest speed, µdeg/s; never 0
    uint32_t acceleration; // acceleration, µdeg/s²; 0: unknown
    uint32_t settle_us; // as in ConfigureTurntable
    uint8_t approach; // as in ConfigureTurntable
};

struct statistics {
    uint16_t command; // sequence number of the answered command
    uint32_t frames; // valid frames received from the host
    uint32_t rejected; // blocks between two zeros that were not valid frames
    uint32_t overruns; // bytes lost because the receive buffer was full
    uint32_t pings; // pings made
    int32_t lost_steps; // sum of the microsteps that were missing at the zero mark
    uint8_t reset_cause; // reset code: cause of the last start
    uint16_t stack_free; // bytes of stack never used; 0: not measured
};

struct link_tested {
    uint16_t command; // sequence number of the answered command
    struct samples data; // the pattern of the TestLink, repeated to the requested size
};

#endif
