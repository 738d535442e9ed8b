/* The serial line as the portable part sees it. */
#ifndef LINE_H
#define LINE_H

#include <stdbool.h>
#include <stdint.h>

// Hand over bytes to be sent; how many of them there was room for.
uint8_t line_write(const uint8_t *bytes, uint8_t count);
// Whether the last bit of all that was handed over has left.
bool line_quiet(void);
// The next byte that has come, or -1.
int16_t line_read(void);

// Bytes that came faster than they were taken.
uint32_t line_overruns(void);
// Change the speed, once the line is quiet; to one that `line_can` says.
void line_set_baud(uint32_t baud);
bool line_can(uint32_t baud);

#endif
