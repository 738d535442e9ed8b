/* Access to constants in flash memory. */
#ifndef FLASH_H
#define FLASH_H

#include <avr/pgmspace.h> // PROGMEM
#include <stdint.h>

#define FLASH PROGMEM
#define FLASH_TEXT(text) PSTR(text)

static inline uint8_t flash_u8(const void *from) { return pgm_read_byte(from); }
static inline uint16_t flash_u16(const uint16_t *from) { return pgm_read_word(from); }
static inline uint32_t flash_u32(const uint32_t *from) { return pgm_read_dword(from); }

#endif
