/* Interface of the serial line. */
#ifndef LINE_H
#define LINE_H

#include <stdbool.h>
#include <stdint.h>

// Queue bytes to send. Returns how many fit into the queue.
uint8_t line_write(const uint8_t *bytes, uint8_t count);
// Whether the last bit of all queued bytes has been sent.
bool line_quiet(void);
// The next received byte, or -1 if there is none.
int16_t line_read(void);

// Bytes lost because the receive buffer was full.
uint32_t line_overruns(void);
// Change the baud rate to one that `line_can` accepts. Call it only while the line is quiet.
void line_set_baud(uint32_t baud);
bool line_can(uint32_t baud);

#endif
