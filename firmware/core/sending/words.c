#include "words.h"

static void add(struct words *words, char letter)
{
    if (words->size < WORDS_MOST)
        words->bytes[words->size++] = letter;
}

void words_add(struct words *words, const char *flash_text)
{
    for (char letter; (letter = (char)flash_u8(flash_text)); flash_text++)
        add(words, letter);
}

static void digits(struct words *words, uint64_t number, uint8_t least)
{
    char backwards[20];
    uint8_t count = 0;
    while (number || count < least) {
        backwards[count++] = (char)('0' + number % 10);
        number /= 10;
    }
    while (count)
        add(words, backwards[--count]);
}

void words_number(struct words *words, int64_t number)
{
    if (number < 0)
        add(words, '-');
    digits(words, number < 0 ? -(uint64_t)number : (uint64_t)number, 1);
}

void words_hex(struct words *words, uint8_t byte)
{
    for (int8_t shift = 4; shift >= 0; shift -= 4) {
        uint8_t digit = byte >> shift & 15;
        add(words, (char)(digit < 10 ? '0' + digit : 'a' + digit - 10));
    }
}

void words_degrees(struct words *words, int64_t microdegrees)
{
    uint64_t size = microdegrees < 0 ? -(uint64_t)microdegrees : (uint64_t)microdegrees;
    if (microdegrees < 0)
        add(words, '-');
    digits(words, size / 1000000, 1);
    uint32_t fraction = (uint32_t)(size % 1000000);
    if (!fraction)
        return;
    uint8_t places = 6;
    for (; fraction % 10 == 0; places--)
        fraction /= 10;
    add(words, '.');
    digits(words, fraction, places);
}

struct text words_text(const struct words *words) { return (struct text){words->bytes, words->size}; }
