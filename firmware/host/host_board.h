/* Control of the test board. */
#ifndef HOST_BOARD_H
#define HOST_BOARD_H

#include <stdbool.h>
#include <stdint.h>

enum host_motor { HOST_MOTOR_RAMPED, HOST_MOTOR_AT_ONCE, HOST_MOTOR_HELD, HOST_MOTOR_SLIPPING };

// wiring faults, added
enum host_wiring {
    HOST_CAM_INVERTED = 1,
    HOST_CAM_OPEN = 2,
    HOST_MOTOR_REVERSED = 4,
    HOST_MARK_OPEN = 8,
    HOST_MARK_INVERTED = 16,
    HOST_DIRECTION_OPEN = 32, // the motor turns counter-clockwise only
};

void host_start(void); // a board after power on, at time 0
void host_identity(const char *firmware, const char *serial, const char *profile); // the texts must stay valid
void host_grain(uint32_t us); // step of the simulated time
void host_temperature(int16_t centidegrees);
void host_set_position(int32_t steps); // move the table by hand
void host_motor(enum host_motor mode); // held: makes no steps; slipping: makes steps, but the table does not move
void host_wiring(uint32_t faults); // enum host_wiring
// Set the result of all following pings: echoes in ticks, earliest first. The trace must stay valid.
void host_set_echoes(const uint32_t *ticks, uint8_t count, const uint8_t *trace, uint16_t trace_size,
                     uint32_t period_ns);

// Mark samples of the present trace as lost, at most LOST_MOST.
void host_set_lost(const uint16_t *indices, uint8_t count);
void host_restart(void); // power off and on: the EEPROM, the table and its wiring stay

void host_send(const uint8_t *bytes, uint32_t size);
uint32_t host_receive(uint8_t *bytes, uint32_t most);
void host_advance(uint64_t until_us);

int32_t host_position(void);
bool host_powered(void);
uint32_t host_baud(void);
uint32_t host_violations(void); // number of steps and writes while listening

#endif
