#include "scan.h"

uint64_t scan_readings(const struct start_scan *scan)
{
    return (uint64_t)scan->headings * scan->sweeps * scan->pings;
}

uint32_t scan_count(const struct start_scan *scan)
{
    uint64_t total = scan_readings(scan);
    if (total > 0xFFFFFFFF || scan->first >= total || scan->count > total - scan->first)
        return 0;
    return scan->count ? scan->count : (uint32_t)total - scan->first;
}

struct place scan_place(const struct start_scan *scan, uint32_t number)
{
    uint32_t heading = number / scan->pings;
    struct place place = {
        .sweep = (uint16_t)(heading / scan->headings),
        .ping = (uint8_t)(number % scan->pings),
    };
    heading %= scan->headings;
    if (place.sweep & 1)
        heading = scan->headings - 1 - heading;
    place.angle = (int32_t)(scan->start + (int64_t)scan->step * heading);
    return place;
}

int64_t scan_end(const struct start_scan *scan)
{
    return scan->start + (int64_t)scan->step * (scan->headings - 1);
}
