/* Fuzz test of frames, messages, conversation and turntable. Sanitizers report the errors.
 *
 * With clang -fsanitize=fuzzer this is a target of libFuzzer. Compiled with -DALONE, it reads one input from standard
 * input, as AFL++ requires. With a count and a seed as arguments, it generates that many sessions: valid frames of all
 * types with hostile values, and occasional flipped bits and dropped bytes.
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "frames.h" // crc_of
#include "host_board.h"

#define BYTE_US 40
#define PAUSE_US 10000
#define REST_US 400000
#define PAYLOAD_MOST 80

static const uint32_t echoes[] = {14000, 28200, 60000, 90000, 124800};
static const uint8_t hello[] = {3, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 7, 1, 1, 0xBF, 0xD2, 0x5B, 0x27, 0};
static uint8_t trace[4800];
static uint64_t now;

static void start(void)
{
    now = 0;
    host_start();
    host_grain(500);
    host_motor(HOST_MOTOR_AT_ONCE);
    host_set_echoes(echoes, 5, trace, sizeof trace, 13000);
}

static void let_pass(uint64_t us)
{
    static uint8_t sent[1 << 16];
    now += us;
    host_advance(now);
    host_receive(sent, sizeof sent);
}

static void send_bytes(const uint8_t *bytes, size_t size)
{
    host_send(bytes, (uint32_t)size);
    let_pass(size * BYTE_US);
}

// Write a valid encoded frame to `to`, which has room for 128 bytes. Returns its size.
static size_t frame_of(uint8_t *to, uint8_t type, uint16_t sequence, const uint8_t *payload, size_t payload_size)
{
    uint8_t body[HEADER_SIZE + PAYLOAD_MOST + CRC_SIZE] = {type, (uint8_t)sequence, (uint8_t)(sequence >> 8)};
    size_t size = HEADER_SIZE + payload_size;
    memcpy(body + HEADER_SIZE, payload, payload_size);
    uint32_t crc = ~crc_of(CRC_START, body, (uint16_t)size);
    memcpy(body + size, &crc, CRC_SIZE);
    size += CRC_SIZE;
    size_t out = 0, code = out++;
    for (size_t at = 0; at < size; at++) {
        if (body[at])
            to[out++] = body[at];
        if (!body[at]) {
            to[code] = (uint8_t)(out - code);
            code = out++;
        }
    }
    to[code] = (uint8_t)(out - code);
    to[out++] = 0;
    return out;
}

// Send Hello, then commands in valid frames. The input contains type, sequence, pause, size and payload of each.
static void converse(const uint8_t *data, size_t size)
{
    uint8_t wire[128];
    send_bytes(hello, sizeof hello);
    while (size >= 4) {
        size_t payload = data[3] % (PAYLOAD_MOST + 1);
        payload = payload < size - 4 ? payload : size - 4;
        send_bytes(wire, frame_of(wire, data[0], data[1], data + 4, payload));
        let_pass(data[2] % 32 * PAUSE_US);
        data += 4 + payload;
        size -= 4 + payload;
    }
}

// The first bit of the input selects its meaning: raw bytes, or commands that are sent in valid frames.
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    start();
    if (size && data[0] & 1)
        converse(data + 1, size - 1);
    else
        for (size_t at = 1; at < size; at++)
            send_bytes(data + at, 1);
    let_pass(REST_US);
    if (host_violations())
        abort();
    return 0;
}

#ifdef ALONE

static uint64_t state;

static uint32_t random_below(uint32_t limit)
{
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    return (uint32_t)(state >> 33) % limit;
}

// Mostly a plausible value, sometimes a random one.
static uint32_t hostile(void)
{
    static const uint32_t known[] = {0, 1, 2, 8, 16, 64, 65, 100, 122, 480, 2380, 20000, 62400, 250000, 1000000,
                                     10000000, 720000000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF};
    return random_below(8) ? known[random_below(sizeof known / sizeof *known)] : random_below(0x7FFFFFFF);
}

static size_t hostile_frame(uint8_t *to)
{
    uint8_t payload[PAYLOAD_MOST + 4] = {0};
    size_t size = 0;
    for (uint32_t field = random_below(12); field && size < PAYLOAD_MOST - 4; field--, size += 1 + random_below(4)) {
        uint32_t value = hostile();
        memcpy(payload + size, &value, 4);
    }
    uint8_t type = (uint8_t)(random_below(16) ? 1 + random_below(13) : random_below(256));
    return frame_of(to, type, (uint16_t)random_below(8), payload, size);
}

static void hostile_session(void)
{
    uint8_t wire[128];
    start();
    send_bytes(hello, sizeof hello);
    for (uint32_t frames = 1 + random_below(30); frames; frames--) {
        size_t size = hostile_frame(wire);
        if (!random_below(6))
            wire[random_below((uint32_t)size)] ^= (uint8_t)(1 << random_below(8));
        send_bytes(wire, size - !random_below(12));
        let_pass(random_below(4) ? 0 : random_below(60) * PAUSE_US);
        send_bytes(wire + size - 1, 1);
    }
    let_pass(REST_US);
    if (host_violations())
        abort();
}

int main(int count, char **words)
{
    static uint8_t input[1 << 16];
    if (count < 3)
        return LLVMFuzzerTestOneInput(input, fread(input, 1, sizeof input, stdin));
    state = strtoull(words[2], NULL, 10);
    for (long sessions = atol(words[1]); sessions; sessions--)
        hostile_session();
    return 0;
}

#endif
