"""Times of a piece of work, for the scripts beside this one."""

import resource
import time

import numpy as np


def clock():
    """Wall and processor time (s) of this process and its threads."""
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return np.array([time.perf_counter(), usage.ru_utime + usage.ru_stime])


def timed(work):
    """What the work gives, and the time (s) that it took: wall, processor."""
    begin = clock()
    result = work()
    return result, clock() - begin
