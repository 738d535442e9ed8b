/* What one byte does to a reflected CRC-32. */
#ifndef CRC_TABLE_H
#define CRC_TABLE_H

#include "flash.h" // FLASH

extern FLASH const uint32_t crc_table[256];

#endif
