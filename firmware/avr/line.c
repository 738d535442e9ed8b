/* The serial line on USART0, with a ring buffer in each direction. */
#include "line.h"

#include <avr/interrupt.h> // ISR
#include <avr/io.h> // registers
#include <util/atomic.h> // ATOMIC_BLOCK

#include "chip_facts.h" // SEND_ROOM
#include "messages.h" // FIRST_BAUD
#include "usart.h"

#define RECEIVE_RING (RECEIVE_ROOM + 1) // bytes; a power of two

static uint8_t sending[SEND_ROOM];
static volatile uint8_t send_in, send_out;
static bool sent_once;
static uint8_t received[RECEIVE_RING];
static volatile uint8_t receive_in, receive_out;
static volatile uint32_t overruns;

void usart_start(void)
{
    UCSR0A = _BV(U2X0);
    line_set_baud(FIRST_BAUD);
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

// At most every 160 cycles, at 1 000 000 baud. Budget 100 cycles.
ISR(USART_RECEIVED_vect)
{
    bool overrun = UCSR0A & _BV(DOR0);
    uint8_t byte = UDR0;
    uint8_t next = (receive_in + 1) & (RECEIVE_RING - 1);
    if (next != receive_out) {
        received[receive_in] = byte;
        receive_in = next;
    } else {
        overrun = true;
    }
    // the frame is lost; the host repeats it
    if (overrun)
        overruns++;
}

// At most every 160 cycles, at 1 000 000 baud. Budget 90 cycles.
ISR(USART_SENT_vect)
{
    uint8_t out = send_out;
    UCSR0A = _BV(U2X0) | _BV(TXC0);
    UDR0 = sending[out];
    if (++out == SEND_ROOM)
        out = 0;
    send_out = out;
    if (out == send_in)
        UCSR0B &= ~_BV(UDRIE0);
}

uint8_t line_write(const uint8_t *bytes, uint8_t count)
{
    uint8_t in = send_in;
    uint8_t out = send_out;
    uint8_t room = (out > in ? out : out + SEND_ROOM) - in - 1;
    if (count > room)
        count = room;
    if (!count)
        return 0;
    for (uint8_t left = count; left; left--) {
        sending[in] = *bytes++;
        if (++in == SEND_ROOM)
            in = 0;
    }
    sent_once = true;
    // together: if the interrupt sent the new bytes in between, it would then send the whole ring again
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        send_in = in;
        UCSR0B |= _BV(UDRIE0);
    }
    return count;
}

bool line_quiet(void) { return !sent_once || (send_in == send_out && (UCSR0A & _BV(TXC0))); }

int16_t line_read(void)
{
    uint8_t out = receive_out;
    if (out == receive_in)
        return -1;
    uint8_t byte = received[out];
    receive_out = (out + 1) & (RECEIVE_RING - 1);
    return byte;
}

uint32_t line_overruns(void)
{
    uint32_t count;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        count = overruns;
    }
    return count;
}

bool line_can(uint32_t baud) { return baud == 250000 || baud == 500000 || baud == 1000000; }

// All three baud rates divide the clock exactly.
void line_set_baud(uint32_t baud) { UBRR0 = (uint16_t)(F_CPU / 8 / baud - 1); }
