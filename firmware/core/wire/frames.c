#include "frames.h"

#include "crc_table.h" // crc_table
#include "line.h" // line_write

#define LONGEST_PIECE 254

uint32_t crc_of(uint32_t crc, const uint8_t *bytes, uint16_t size)
{
    for (; size; size--)
        crc = (crc >> 8) ^ flash_u32(&crc_table[(uint8_t)crc ^ *bytes++]);
    return crc;
}

/* Receiving. */

void receiver_start(struct receiver *receiver)
{
    receiver->size = 0;
    receiver->crc = CRC_START;
    receiver->piece = 0;
    receiver->zero_due = false;
    receiver->broken = false;
}

static void keep(struct receiver *receiver, uint8_t byte)
{
    if (receiver->size == RECEIVED_MOST) {
        receiver->broken = true;
        return;
    }
    receiver->bytes[receiver->size++] = byte;
    receiver->crc = crc_of(receiver->crc, &byte, 1);
}

static bool ended(struct receiver *receiver, struct command_frame *frame)
{
    bool valid = !receiver->broken && !receiver->piece && receiver->size >= HEADER_SIZE + CRC_SIZE &&
                 receiver->crc == CRC_RESIDUE;
    // an empty block is not an error; zero_due distinguishes it from a block that decodes to nothing
    bool silence = !receiver->size && !receiver->piece && !receiver->zero_due && !receiver->broken;
    if (valid) {
        struct payload header = payload_of(receiver->bytes, HEADER_SIZE);
        frame->type = get_u8(&header);
        frame->sequence = get_u16(&header);
        frame->payload = receiver->bytes + HEADER_SIZE;
        frame->size = receiver->size - HEADER_SIZE - CRC_SIZE;
        receiver->frames++;
    } else if (!silence) {
        receiver->rejected++;
    }
    receiver_start(receiver);
    return valid;
}

bool receiver_take(struct receiver *receiver, uint8_t byte, struct command_frame *frame)
{
    if (byte == 0)
        return ended(receiver, frame);
    if (receiver->broken)
        return false;
    if (receiver->piece) {
        receiver->piece--;
        keep(receiver, byte);
        return false;
    }
    if (receiver->zero_due)
        keep(receiver, 0);
    receiver->piece = byte - 1;
    receiver->zero_due = byte <= LONGEST_PIECE;
    return false;
}

/* Sending. */

struct payload sender_payload(struct sender *sender)
{
    return payload_of(sender->head + HEADER_SIZE, HEAD_MOST - HEADER_SIZE - CRC_SIZE);
}

static uint32_t crc_of_tail(uint32_t crc, const struct sender *sender)
{
    for (uint16_t left = sender->tail_size; left;) {
        uint16_t size = left < sender->tail_period ? left : sender->tail_period;
        crc = crc_of(crc, sender->tail, size);
        left -= size;
    }
    return crc;
}

void sender_send(struct sender *sender, uint8_t type, uint64_t time_us, const struct payload *payload)
{
    struct payload frame = payload_of(sender->head, HEADER_SIZE);
    put_u8(&frame, type);
    put_u16(&frame, sender->sequence++);
    put_u64(&frame, time_us);
    uint8_t behind = HEADER_SIZE + (uint8_t)payload->at;
    sender->tail = payload->tail;
    sender->tail_size = payload->tail_size;
    sender->tail_period = payload->tail_period;
    sender->head_front = HEADER_SIZE + (uint8_t)(payload->tail_size ? payload->tail_at : payload->at);
    uint32_t crc = crc_of(CRC_START, sender->head, sender->head_front);
    crc = crc_of_tail(crc, sender);
    crc = ~crc_of(crc, sender->head + sender->head_front, behind - sender->head_front);
    frame.at = behind;
    frame.size = HEAD_MOST;
    put_u32(&frame, crc);
    sender->head_size = (uint8_t)frame.at;
    sender->at = 0;
    sender->piece = 0;
    sender->zero_due = false;
    sender->sending = true;
}

// The contiguous bytes of the frame from byte `at` on; `*size` of them.
static const uint8_t *stretch(const struct sender *sender, uint16_t at, uint16_t *size)
{
    if (at < sender->head_front) {
        *size = sender->head_front - at;
        return sender->head + at;
    }
    uint16_t in_tail = at - sender->head_front;
    if (in_tail < sender->tail_size) {
        uint16_t left = sender->tail_size - in_tail;
        uint16_t in_period = in_tail < sender->tail_period ? in_tail : in_tail % sender->tail_period;
        *size = sender->tail_period - in_period < left ? sender->tail_period - in_period : left;
        return sender->tail + in_period;
    }
    uint16_t in_head = at - sender->tail_size;
    *size = in_head < sender->head_size ? sender->head_size - in_head : 0;
    return sender->head + in_head;
}

// Number of bytes from `at` to the next zero or the end of the frame; at most LONGEST_PIECE.
static uint8_t piece_at(const struct sender *sender, uint16_t at)
{
    uint8_t length = 0;
    for (;;) {
        uint16_t size;
        const uint8_t *bytes = stretch(sender, at + length, &size);
        if (!size)
            return length;
        for (; size; size--) {
            if (!*bytes++)
                return length;
            if (++length == LONGEST_PIECE)
                return length;
        }
    }
}

// Send the next code or the delimiter. False if the line accepts no more bytes.
static bool send_code(struct sender *sender, uint16_t frame_size)
{
    uint16_t from = sender->at + (sender->zero_due ? 1 : 0);
    bool over = sender->at == frame_size && !sender->zero_due;
    uint8_t length = over ? 0 : piece_at(sender, from);
    uint8_t code = over ? 0 : length + 1;
    if (!line_write(&code, 1))
        return false;
    sender->at = from;
    sender->piece = length;
    // no zero follows a piece of full length or the last piece
    sender->zero_due = length < LONGEST_PIECE && from + length < frame_size;
    sender->sending = !over;
    return true;
}

void sender_pump(struct sender *sender)
{
    uint16_t frame_size = sender->head_size + sender->tail_size;
    while (sender->sending) {
        if (!sender->piece) {
            if (!send_code(sender, frame_size))
                return;
            continue;
        }
        uint16_t size;
        const uint8_t *bytes = stretch(sender, sender->at, &size);
        uint8_t taken = line_write(bytes, size < sender->piece ? (uint8_t)size : sender->piece);
        sender->at += taken;
        sender->piece -= taken;
        if (!taken)
            return;
    }
}
