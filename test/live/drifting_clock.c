/* SPDX-FileCopyrightText: 2026 The crgame_ros authors
   SPDX-License-Identifier: Apache-2.0

   Loaded before a program (LD_PRELOAD), it makes that program's steady clock run 50 ppm too fast,
   as if it had done so for 1000 s: 50 ms ahead at the start. Its system clock stays right. */

#define _GNU_SOURCE
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

static long long begun_ns;

int clock_gettime(clockid_t id, struct timespec *now)
{
    int failed = (int)syscall(SYS_clock_gettime, id, now);
    if (failed || id != CLOCK_MONOTONIC)
        return failed;
    long long ns = now->tv_sec * 1000000000LL + now->tv_nsec;
    if (!begun_ns)
        begun_ns = ns;
    ns += (ns - begun_ns + 1000000000000LL) / 20000;
    now->tv_sec = ns / 1000000000LL;
    now->tv_nsec = ns % 1000000000LL;
    return 0;
}
