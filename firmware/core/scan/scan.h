/* The scan program: which heading, sweep and ping belongs to a reading's number. */
#ifndef SCAN_H
#define SCAN_H

#include "messages.h" // struct start_scan

struct place {
    uint16_t sweep;
    uint8_t ping;
    int32_t angle; // µdeg, as asked for
};

// How many readings the whole of a scan has.
uint64_t scan_readings(const struct start_scan *scan);
// How many of them are asked for; 0 where they are not all of that scan, or it has more than can be counted.
uint32_t scan_count(const struct start_scan *scan);
struct place scan_place(const struct start_scan *scan, uint32_t number);
// The heading farthest from `start`, µdeg; it may be beyond any cable.
int64_t scan_end(const struct start_scan *scan);

#endif
