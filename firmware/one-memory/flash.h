/* Access to constants on a machine with a single memory. */
#ifndef FLASH_H
#define FLASH_H

#include <stdint.h>

#define FLASH
#define FLASH_TEXT(text) (text)

static inline uint8_t flash_u8(const void *from) { return *(const uint8_t *)from; }
static inline uint16_t flash_u16(const uint16_t *from) { return *from; }
static inline uint32_t flash_u32(const uint32_t *from) { return *from; }

#endif
