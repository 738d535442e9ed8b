/* Texts for the user, composed of pieces in flash and numbers. Texts that are too long are cut off. */
#ifndef WORDS_H
#define WORDS_H

#include <stdint.h>

#include "fields.h" // struct text
#include "flash.h" // FLASH_TEXT

#define WORDS_MOST 100

struct words {
    char bytes[WORDS_MOST];
    uint8_t size;
};

void words_add(struct words *words, const char *flash_text);
void words_number(struct words *words, int64_t number);
void words_hex(struct words *words, uint8_t byte);
void words_degrees(struct words *words, int64_t microdegrees); // 12.5, without trailing zeros
struct text words_text(const struct words *words);

#endif
