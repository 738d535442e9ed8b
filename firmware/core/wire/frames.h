/* Frames: how a message becomes bytes on the line and how bytes become frames again.
 *
 *     frame = COBS( type u8 · sequence u16 · time u64 · payload · CRC-32 u32 ) · 0x00        little-endian
 *
 * Both directions work byte by byte as the line gives and takes them, so neither needs room for a whole frame.
 */
#ifndef FRAMES_H
#define FRAMES_H

#include "messages.h" // struct payload

#define HEADER_SIZE 11 // type, sequence, time
#define CRC_SIZE 4

#define CRC_START 0xFFFFFFFF
#define CRC_RESIDUE 0xDEBB20E3 // what CRC-32 comes to behind a sound frame and its own CRC, before the inversion

uint32_t crc_of(uint32_t crc, const uint8_t *bytes, uint16_t size);

/* Receiving. */

#define RECEIVED_MOST 95 // bytes of a frame from a host: header, 80 of payload, CRC

struct receiver {
    uint8_t bytes[RECEIVED_MOST];
    uint8_t size; // bytes of the frame so far, CRC included
    uint32_t crc;
    uint8_t piece; // bytes to come before the next code
    bool zero_due; // the piece that ends stands for a zero behind it
    bool broken; // what comes is thrown away up to the next delimiter
    uint32_t frames, rejected; // blocks that were a frame, and that were none, since the start
};

struct command_frame {
    uint8_t type;
    uint16_t sequence;
    const uint8_t *payload; // lies in the receiver until its next byte
    uint8_t size; // of the payload
};

void receiver_start(struct receiver *receiver);
// Take one byte; true where it completed a sound frame, which is then in `frame`.
bool receiver_take(struct receiver *receiver, uint8_t byte, struct command_frame *frame);

/* Sending: one frame at a time; its tail, if it has one, is sent from where it lies. */

#define HEAD_MOST 116 // bytes of a frame besides its tail

struct sender {
    uint8_t head[HEAD_MOST];
    uint8_t head_size, head_front; // bytes of it; bytes of it in front of the tail
    const uint8_t *tail;
    uint16_t tail_size, tail_period;
    uint16_t at; // bytes of the frame that have left
    uint8_t piece; // bytes left to send of the current piece
    bool zero_due; // a zero of the frame stands behind this piece: the next code is for what follows it
    bool sending;
    uint16_t sequence; // of the next frame
};

// Where the payload of the next message is to be packed; valid until sender_send.
struct payload sender_payload(struct sender *sender);
// Begin to send what was packed. The sender must be idle; the tail must stay as it is until it is idle again.
void sender_send(struct sender *sender, uint8_t type, uint64_t time_us, const struct payload *payload);
// Hand the line as many bytes as it takes.
void sender_pump(struct sender *sender);

#endif
