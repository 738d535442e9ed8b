/* Written by generate.py; change that, not this. */

#include "thermistor_table.h"

FLASH const int16_t thermistor_table[33] = {
    12500, 12500, 10160, 8661, 7633, 6849, 6211, 5669, 5196, 4772, 4387,
    4030, 3696, 3379, 3077, 2784, 2500, 2221, 1945, 1670, 1393, 1113,
    825, 528, 217, -114, -471, -867, -1318, -1859, -2560, -3637, -4000,
};
