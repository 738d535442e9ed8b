/* Encoding and decoding of frames.
 *
 *     frame = COBS( type u8 · sequence u16 · time u64 · payload · CRC-32 u32 ) · 0x00        little-endian
 *
 * Both directions work byte by byte, so that no buffer for a whole encoded frame is needed.
 */
#ifndef FRAMES_H
#define FRAMES_H

#include "messages.h" // struct payload

#define HEADER_SIZE 11 // type, sequence, time
#define CRC_SIZE 4

#define CRC_START 0xFFFFFFFF
#define CRC_RESIDUE 0xDEBB20E3 // CRC-32 over a valid frame and its CRC, before the inversion

uint32_t crc_of(uint32_t crc, const uint8_t *bytes, uint16_t size);

/* Receiving. */

#define RECEIVED_MOST 95 // bytes of a frame from a host: header, 80 of payload, CRC

struct receiver {
    uint8_t bytes[RECEIVED_MOST];
    uint8_t size; // bytes of the frame so far, CRC included
    uint32_t crc;
    uint8_t piece; // bytes left in the current piece
    bool zero_due; // a zero follows the current piece
    bool broken; // discard everything up to the next delimiter
    uint32_t frames, rejected; // valid and invalid blocks since the start
};

struct command_frame {
    uint8_t type;
    uint16_t sequence;
    const uint8_t *payload; // in the receiver; valid until its next byte
    uint8_t size; // of the payload
};

void receiver_start(struct receiver *receiver);
// Process one byte. True if it completes a valid frame, which is then in `frame`.
bool receiver_take(struct receiver *receiver, uint8_t byte, struct command_frame *frame);

/* Sending: one frame at a time. The tail of a frame is not copied. */

#define HEAD_MOST 116 // bytes of a frame besides its tail

struct sender {
    uint8_t head[HEAD_MOST];
    uint8_t head_size, head_front; // size; size of the part before the tail
    const uint8_t *tail;
    uint16_t tail_size, tail_period;
    uint16_t at; // bytes of the frame sent so far
    uint8_t piece; // bytes left to send of the current piece
    bool zero_due; // a zero follows this piece; the next code is for the piece after it
    bool sending;
    uint16_t sequence; // of the next frame
};

// Buffer for the payload of the next message; valid until sender_send.
struct payload sender_payload(struct sender *sender);
// Begin to send the packed message. The sender must be idle. The tail must not change until it is idle again.
void sender_send(struct sender *sender, uint8_t type, uint64_t time_us, const struct payload *payload);
// Pass as many bytes to the line as it accepts.
void sender_pump(struct sender *sender);

#endif
