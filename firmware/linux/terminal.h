/* The serial line of `line.h` is a pseudo-terminal, which a host opens like the port of any board. */
#ifndef TERMINAL_H
#define TERMINAL_H

const char *terminal_start(const char *link); // a symbolic link to it, or NULL; returns the name to open
int terminal_descriptor(void); // readable when bytes have come; -1 while no host has opened it
void terminal_flush(void); // send what has been written

#endif
