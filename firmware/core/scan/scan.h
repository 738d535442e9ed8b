/* Heading, sweep and ping of each reading number of a scan. */
#ifndef SCAN_H
#define SCAN_H

#include "messages.h" // struct start_scan

struct place {
    uint16_t sweep;
    uint8_t ping;
    int32_t angle; // µdeg, as commanded
};

// Number of readings of the whole scan.
uint64_t scan_readings(const struct start_scan *scan);
// Number of readings that are requested; 0 if `first` or `count` is out of range or the scan is longer than u32.
uint32_t scan_count(const struct start_scan *scan);
struct place scan_place(const struct start_scan *scan, uint32_t number);
// The last heading of a sweep, µdeg; may be beyond the limits of the cable.
int64_t scan_end(const struct start_scan *scan);

#endif
