/* Fuzzing of everything behind the line: frames, messages, conversation, turntable.
 *
 * With clang -fsanitize=fuzzer this is libFuzzer's target; compiled with -DALONE it reads an input from standard input,
 * as AFL++ wants it, or, with a count and a seed, makes as many sessions of its own: sound frames of all types with
 * hostile values, bits flipped and bytes dropped now and then. What goes wrong, the sanitizers tell.
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "frames.h" // crc_of
#include "host.h"

#define BYTE_US 40
#define REST_US 400000

static const uint32_t echoes[] = {14000, 28200, 60000, 90000, 124800};
static uint8_t trace[4800];

// An input is the bytes of a line; a byte of 0xFE in it lets ten milliseconds pass.
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint8_t sent[1 << 16];
    uint64_t now = 0;
    host_start();
    host_grain(500);
    host_motor(HOST_MOTOR_AT_ONCE);
    host_hear(echoes, 5, trace, sizeof trace, 13000);
    for (size_t at = 0; at < size; at++) {
        host_send(data + at, 1);
        now += data[at] == 0xFE ? 10000 : BYTE_US;
        host_advance(now);
        host_receive(sent, sizeof sent);
    }
    host_advance(now + REST_US);
    if (host_trespasses())
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

// Mostly a number that could be meant, now and then one that could not.
static uint32_t hostile(void)
{
    static const uint32_t known[] = {0, 1, 2, 8, 16, 64, 65, 100, 122, 480, 2380, 20000, 62400, 250000, 1000000,
                                     10000000, 720000000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF};
    return random_below(8) ? known[random_below(sizeof known / sizeof *known)] : random_below(0x7FFFFFFF);
}

static size_t make_frame(uint8_t *to)
{
    struct sender sender = {.sequence = (uint16_t)random_below(8)};
    uint8_t body[95] = {(uint8_t)(random_below(16) ? 1 + random_below(13) : random_below(256)), 0};
    size_t size = 11;
    body[1] = (uint8_t)sender.sequence;
    for (uint32_t field = random_below(12); field && size < 80; field--, size += 1 + random_below(4)) {
        uint32_t value = hostile();
        memcpy(body + size, &value, 4);
    }
    uint32_t crc = ~crc_of(CRC_START, body, (uint16_t)size);
    memcpy(body + size, &crc, 4);
    size += 4;
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

static const uint8_t hello[] = {3, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 7, 1, 1, 0xBF, 0xD2, 0x5B, 0x27, 0};

static size_t make_session(uint8_t *to)
{
    size_t size = sizeof hello;
    memcpy(to, hello, size);
    for (uint32_t frames = 1 + random_below(30); frames; frames--) {
        size_t more = make_frame(to + size);
        if (!random_below(6))
            to[size + random_below((uint32_t)more)] ^= (uint8_t)(1 << random_below(8));
        size += more - !random_below(12);
        for (uint32_t pause = random_below(20); pause > 14; pause--)
            to[size++] = 0xFE;
        to[size++] = 0;
    }
    return size;
}

int main(int count, char **words)
{
    static uint8_t input[1 << 16];
    if (count < 3) {
        size_t size = fread(input, 1, sizeof input, stdin);
        return LLVMFuzzerTestOneInput(input, size);
    }
    state = strtoull(words[2], NULL, 10);
    for (long sessions = atol(words[1]); sessions; sessions--)
        LLVMFuzzerTestOneInput(input, make_session(input));
    return 0;
}

#endif
