/* Knot intervals that are halved, those first that lose most, until they lose little enough together. */

#include <math.h>
#include <stdlib.h>

/* A timing at M times: t, ascending; accelerations, (M, n); the rate dp/dt, (M); and between two times how much of an
acceleration jumps, and what a ramp in place of a jump costs, (M - 1). */
typedef struct {
    long times, joints;
    const double *t, *accelerations, *rate, *jumps, *ramps;
    long least_times; /* within an interval, to tell whether it is smooth */
} timing;

typedef struct {
    double loss, low, high;
} interval;

/* Number of the first time that is not below a value. */
static long find_place(const timing *timing, double value)
{
    long low = 0;
    long high = timing->times;
    while (low < high) {
        long middle = low + (high - low) / 2;
        if (timing->t[middle] < value) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

/* What an interval loses: its length times how far accelerations are from linear within it. */
static double find_loss(const timing *timing, double low, double high)
{
    long first = find_place(timing, low) - 1;
    long last = find_place(timing, high);
    first = first < 0 ? 0 : first;
    last = last < timing->times ? last : timing->times - 1;
    if (last - first < 2) {
        return 0.0;
    }
    const double *begin = timing->accelerations + first * timing->joints;
    const double *end = timing->accelerations + last * timing->joints;
    double off = 0.0;
    double slowest = INFINITY;
    double jump = 0.0;
    double late = 0.0;
    for (long k = first; k <= last; k++) {
        double share = (timing->t[k] - timing->t[first]) / (timing->t[last] - timing->t[first]);
        const double *values = timing->accelerations + k * timing->joints;
        for (long i = 0; i < timing->joints; i++) {
            off = fmax(off, fabs(values[i] - (begin[i] + share * (end[i] - begin[i]))));
        }
        slowest = fmin(slowest, timing->rate[k]);
        if (k < last) {
            jump = fmax(jump, timing->jumps[k]);
            late = fmax(late, timing->ramps[k]);
        }
    }
    double length = high - low;
    late *= length;
    double share_lost = late < slowest ? late / slowest : 1.0;
    double smooth = last - first + 1 >= timing->least_times ? off - jump : 0.0;
    return length * fmax(smooth, off * share_lost);
}

static int comes_before(const interval *a, const interval *b)
{
    return a->loss > b->loss || (a->loss == b->loss && a->low < b->low);
}

/* Let the last interval of a heap rise to where it belongs. */
static void rise(interval *heap, long count)
{
    long i = count - 1;
    while (i > 0 && comes_before(&heap[i], &heap[(i - 1) / 2])) {
        interval risen = heap[i];
        heap[i] = heap[(i - 1) / 2];
        heap[(i - 1) / 2] = risen;
        i = (i - 1) / 2;
    }
}

/* Let the first interval of a heap sink to where it belongs. */
static void sink(interval *heap, long count)
{
    long i = 0;
    for (;;) {
        long next = 2 * i + 1;
        if (next >= count) {
            return;
        }
        if (next + 1 < count && comes_before(&heap[next + 1], &heap[next])) {
            next++;
        }
        if (!comes_before(&heap[next], &heap[i])) {
            return;
        }
        interval sunk = heap[i];
        heap[i] = heap[next];
        heap[next] = sunk;
        i = next;
    }
}

/* Halve `begin_count` equal intervals of 0 to 1 until they lose less than `tolerance` together, or are `max_count`. Those shorter
than `shortest` stay as they are. `begins` has `room` for two more than the larger of both numbers. Returns how many there are, 0
without memory; `begins` is where they begin, in any order. */
long brachis_halve(
    const timing *timing, long begin_count, double tolerance, double shortest, long max_count, long room, double *begins
)
{
    interval *heap = malloc(room * sizeof(interval));
    if (!heap) {
        return 0;
    }
    long open = 0;
    long done = 0;
    double lost = 0.0;
    for (long i = 0; i < begin_count; i++) {
        double low = (double)i / (double)begin_count;
        double high = (double)(i + 1) / (double)begin_count;
        heap[open++] = (interval){find_loss(timing, low, high), low, high};
        lost += heap[open - 1].loss;
        rise(heap, open);
    }
    while (lost > tolerance && open > 0 && open + done < max_count) {
        interval worst = heap[0];
        lost -= worst.loss;
        heap[0] = heap[--open];
        sink(heap, open);
        if (worst.high - worst.low < shortest) {
            begins[done++] = worst.low;
            continue;
        }
        double middle = 0.5 * (worst.low + worst.high);
        double ends[3] = {worst.low, middle, worst.high};
        for (int half = 0; half < 2; half++) {
            heap[open++] = (interval){find_loss(timing, ends[half], ends[half + 1]), ends[half], ends[half + 1]};
            lost += heap[open - 1].loss;
            rise(heap, open);
        }
    }
    for (long i = 0; i < open; i++) {
        begins[done++] = heap[i].low;
    }
    free(heap);
    return done;
}
