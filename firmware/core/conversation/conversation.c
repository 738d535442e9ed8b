#include "conversation.h"

#include "action.h" // home, turn, scan
#include "board_facts.h" // defaults
#include "commands.h" // obey
#include "hardware.h" // clock_us
#include "kept.h" // kept_end
#include "line.h" // line_read
#include "turntable.h" // turntable_release
#include "voice.h" // say_heartbeat

static struct receiver receiver;
static bool greeted;
static bool watching; // the host has promised signs of life
static uint64_t heard_us; // when the last sound frame came
static uint64_t heartbeat_us; // when the next is due

static struct {
    uint32_t now;
    uint32_t next; // to be changed to; 0: none
    uint32_t former; // to go back to where nothing is heard at the new one; 0: it is settled
    bool on_trial; // whether the next one has to be heard at
} baud;

void conversation_reset(void)
{
    receiver_start(&receiver);
    receiver.frames = receiver.rejected = 0;
    greeted = watching = false;
    baud.now = FIRST_BAUD;
    baud.next = baud.former = 0;
    ping_settings = (struct configure){
        .listen_us = LISTEN_MOST_US,
        .blanking_us = BLANKING_US,
        .speed_of_sound = 343200,
        .pulses = PULSES_SENT,
        .echoes = ECHOES_BESIDE_TRACE,
        .rearm_us = REARM_LEAST_US,
    };
    voice_reset();
    turntable_reset();
    action_reset();
}

void conversation_greeted(const struct hello *hello)
{
    greeted = true;
    watching = hello->major > 1 || (hello->major == 1 && hello->minor >= 1);
    heartbeat_us = clock_us() + HEARTBEAT_US;
}

/* The speed of the line. */

void conversation_change_baud(uint32_t wanted)
{
    baud.next = wanted;
    baud.on_trial = true;
}

static void use_baud(uint32_t wanted)
{
    baud.now = wanted;
    line_set_baud(wanted);
}

static void change_baud_when_quiet(uint64_t now_us)
{
    if (!baud.next || !voice_idle() || !line_quiet())
        return;
    baud.former = baud.on_trial ? baud.now : 0;
    use_baud(baud.next);
    baud.next = 0;
    heard_us = now_us;
}

/* The host. */

static void miss_host(void)
{
    action_stop();
    action_forget();
    action_send_again(0, 0);
    turntable_release();
    greeted = false;
    baud.next = FIRST_BAUD;
    baud.on_trial = false;
}

static void watch_host(uint64_t now_us)
{
    if (action_listening())
        return;
    if (baud.former && now_us - heard_us >= UNHEARD_US) {
        use_baud(baud.former);
        baud.former = 0;
        heard_us = now_us;
    } else if (greeted && watching && now_us - heard_us >= HOST_SILENCE_US) {
        miss_host();
    }
}

static void hear(void)
{
    struct command_frame frame;
    // a command that fires a ping, or changes the speed of the line, ends the hearing
    for (int16_t byte; !action_listening() && !baud.next && (byte = line_read()) >= 0;) {
        if (!receiver_take(&receiver, (uint8_t)byte, &frame))
            continue;
        heard_us = clock_us();
        baud.former = 0;
        obey(&frame, &receiver, greeted);
    }
}

// One thing at a time, the most wanted first; there is always room for an answer in between.
static void speak(uint64_t now_us)
{
    if (!voice_idle() || action_listening())
        return;
    if (!greeted || now_us < heartbeat_us) {
        action_speak();
        return;
    }
    heartbeat_us += HEARTBEAT_US;
    if (heartbeat_us <= now_us)
        heartbeat_us = now_us + HEARTBEAT_US;
    say_heartbeat(&(struct heartbeat){
        .state = action_state(),
        .angle = turntable_microdegrees(),
        .readings = kept_end(),
        .temperature = thermometer(),
        .boot = boot_count(),
        .homed = turntable_homed(),
    });
}

void conversation_run(void)
{
    voice_pump();
    hear();
    uint64_t now_us = clock_us();
    change_baud_when_quiet(now_us);
    watch_host(now_us);
    action_work(now_us);
    speak(now_us);
}
