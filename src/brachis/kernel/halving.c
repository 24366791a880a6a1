/* Knot intervals that are halved, those first that lose most, until they lose little enough together. */

#include <math.h>
#include <stdlib.h>

/* A timing at M times: t, ascending; accelerations, (M, n); the rate dp/dt, (M); and between two times how much of an
acceleration jumps, and what a ramp in place of a jump costs, (M - 1). */
typedef struct {
    long times, joints;
    const double *t, *accelerations, *rate, *jumps, *ramps;
    long few; /* Times within an interval that are needed to tell whether it is smooth. */
} timing;

typedef struct {
    double loss, low, high;
} interval;

/* Number of the first time that is not below a value. */
static long place(const timing *own, double value)
{
    long low = 0;
    long high = own->times;
    while (low < high) {
        long middle = low + (high - low) / 2;
        if (own->t[middle] < value) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

/* What an interval loses: its length times how far accelerations are from linear within it. */
static double loss(const timing *own, double low, double high)
{
    long first = place(own, low) - 1;
    long last = place(own, high);
    first = first < 0 ? 0 : first;
    last = last < own->times ? last : own->times - 1;
    if (last - first < 2) {
        return 0.0;
    }
    const double *begin = own->accelerations + first * own->joints;
    const double *end = own->accelerations + last * own->joints;
    double off = 0.0;
    double slowest = INFINITY;
    double jump = 0.0;
    double late = 0.0;
    for (long k = first; k <= last; k++) {
        double part = (own->t[k] - own->t[first]) / (own->t[last] - own->t[first]);
        const double *values = own->accelerations + k * own->joints;
        for (long i = 0; i < own->joints; i++) {
            off = fmax(off, fabs(values[i] - (begin[i] + part * (end[i] - begin[i]))));
        }
        slowest = fmin(slowest, own->rate[k]);
        if (k < last) {
            jump = fmax(jump, own->jumps[k]);
            late = fmax(late, own->ramps[k]);
        }
    }
    double length = high - low;
    late *= length;
    double part_lost = late < slowest ? late / slowest : 1.0;
    double smooth = last - first + 1 >= own->few ? off - jump : 0.0;
    return length * fmax(smooth, off * part_lost);
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
        interval own = heap[i];
        heap[i] = heap[(i - 1) / 2];
        heap[(i - 1) / 2] = own;
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
        interval own = heap[i];
        heap[i] = heap[next];
        heap[next] = own;
        i = next;
    }
}

/* Halve `pieces` equal intervals of 0 to 1 until they lose less than `tolerance` together, or are `most`. Those shorter than
`shortest` stay as they are. For the others see `timing`. `begins` has `room` for two more than the larger of both numbers.
Returns how many there are, 0 without memory; `begins` is where they begin, in any order. */
long brachis_halve(
    long times, long joints, const double *t, const double *accelerations, const double *rate, const double *jumps,
    const double *ramps, long few, long pieces, double tolerance, double shortest, long most, long room, double *begins
)
{
    const timing own = {times, joints, t, accelerations, rate, jumps, ramps, few};
    interval *heap = malloc(room * sizeof(interval));
    if (!heap) {
        return 0;
    }
    long open = 0;
    long done = 0;
    double lost = 0.0;
    for (long i = 0; i < pieces; i++) {
        double low = (double)i / (double)pieces;
        double high = (double)(i + 1) / (double)pieces;
        heap[open++] = (interval){loss(&own, low, high), low, high};
        lost += heap[open - 1].loss;
        rise(heap, open);
    }
    while (lost > tolerance && open > 0 && open + done < most) {
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
        for (int part = 0; part < 2; part++) {
            heap[open++] = (interval){loss(&own, ends[part], ends[part + 1]), ends[part], ends[part + 1]};
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
