/* The inner loops of a hop, compiled: a few calls instead of numpy's many.
 *
 * Each function is the twin of the Python code named above it, and computes the same but for rounding; the tests compare
 * the two. It is optional: `compiled.py` tells whether it was built, and without it numpy computes the same, more slowly.
 *
 * Memory is the caller's, in numpy's arrays; none is allocated while a feed runs. Shapes and types are checked here, once
 * a call, and a wrong one raises ValueError; the loops in `loops.h` take for granted that they fit.
 */
#define Py_LIMITED_API 0x030B0000
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#if !defined(__GNUC__)
#error "these loops are written for gcc and clang; without them numpy does the same"
#endif

/* Of stream.recognizer.windows.rolling. */
#define DRIFT_TOLERANCE 1e-11
#define NO_MOVEMENT 1e-6
/* Frames measured side by side. */
#define TOGETHER 4
/* Sizes for which the stack has room; larger ones are left to numpy. */
#define MAX_JOINTS 256
#define MAX_DIRECTIONS 32
#define MAX_PARTS 8
#define MAX_VIEWS 8
#define MAX_AXES 256
#define MAX_WINDOWS 10000000
#define MAX_NUMBERS (MAX_JOINTS * (MAX_JOINTS - 1) / 2)
#define MAX_OWNED (6 * MAX_PARTS + 7)
#define MAX_ARGUMENTS 12
/* Eigenvectors of a window that are compared with another's. */
#define EIGENVECTORS 4
/* Bytes of a cache line. */
#define LINE 64
/* Axes, windows and pairs whose sums are kept in registers. */
#define LANE 64
/* Points whose products are added up in registers. */
#define SOME_POINTS 16
/* Numbers beside a tridiagonal matrix's diagonal that count as 0, when its trace is 1; turns after which all do. */
#define NO_EIGENVALUE 1e-12
#define MAX_TURNS 60
/* Bounds between which each eigenvalue is searched at once, and the number of searches. */
#define SECTIONS 8
#define PASSES 6
#define BOUNDS (SECTIONS * EIGENVECTORS)
/* Vectors that are iterated together, of which EIGENVECTORS are wanted; products after which, and at most, the residuals are
 * looked at, both odd; and the residual that is none, when the trace is 1. */
#define BLOCK 8
#define ITERATIONS 7
#define MAX_ITERATIONS 11
#define NO_RESIDUAL 1e-9
/* Bins of phases that count as the same. */
#define MAX_BINS 64
/* Floats of the widest register. */
#define MAX_FLOATS 16
/* A squared distance above all others. */
#define FARTHEST 1e30F

/* A number in half precision, because reading half as much is quicker. */
typedef uint16_t Half;

/* library.windows.metric.Metric: maps numbers to a vector. */
typedef struct {
    Py_ssize_t numbers, kept, stride; /* from one number's axes to the next's: a multiple of LANE */
    float *origin;                    /* (numbers) */
    Half *axes;                       /* (numbers, stride) */
} Metric;

/* A part of a signature: of distances, or so many scaled eigenvectors in so many directions. */
typedef struct {
    Py_ssize_t vectors, directions; /* 0 for a part of distances */
    Metric metric;                  /* empty for eigenvectors that are compared unchanged */
} Part;

/* Parts compared as one vector, and the library's windows as such vectors. */
typedef struct {
    int members[MAX_PARTS], count, between; /* whether eigenvectors are compared unchanged */
    Py_ssize_t axes;                         /* directions, if they are unchanged */
    Metric joint;                            /* empty for no metric */
    Half *windows;                           /* (lanes, axes or EIGENVECTORS * axes, LANE) */
    float *lengths;                          /* |b|² + nearest, (lanes, LANE) */
} Group;

/* library.windows.index.WindowIndex */
typedef struct {
    PyObject_HEAD
    int parts, groups, views;
    Part part[MAX_PARTS];
    Group group[MAX_PARTS];
    float weights[MAX_VIEWS][MAX_PARTS], nearest;
    Py_ssize_t windows, lanes, blocks, classes, wanted; /* number of groups */
    Py_ssize_t *block_starts, *class_starts; /* one more than blocks: the last one's end */
    Py_ssize_t directions;
    float *eigenvectors;                     /* the windows' leading ones, (lanes, directions, LANE) */
    float *room;                             /* (MAX_NUMBERS): what place() works on */
    float (*placed)[MAX_AXES];              /* (MAX_PARTS) */
    float *products;                         /* (MAX_VIEWS, lanes, LANE) */
    void *owned[MAX_OWNED];
    int blocks_owned;
} Table;

/* The moments of the recordings of one class, through which a body is followed, and the constants of a step. */
typedef struct {
    Py_ssize_t count, recordings, axes, rows;
    const double *phases, *beginning, *rounds, *alike; /* (count) each */
    const Py_ssize_t *bins, *order, *starts;           /* (count), (count), (recordings) */
    const float *vectors, *lengths;                    /* (axes, count), (count) */
    const double *expected;                            /* (rows, count) */
    double stay, one, two, changes, begins, again, sharpness, near;
} Course;

/* gcc on Windows spills wide registers to where the stack is not aligned for them, and crashes (its bug 54412). */
#if defined(__x86_64__) && (!defined(_WIN32) || defined(__clang__))
#define WIDE_REGISTERS
#endif

#if defined(WIDE_REGISTERS)
#include <cpuid.h>
#include <immintrin.h>
/* clang ignores a whole target attribute with an option it does not know, and uses 512-bit registers without being told. */
#if defined(__clang__)
#define PREFERRED ""
#else
#define PREFERRED ",prefer-vector-width=512"
#endif
#define REGISTER 64
#define KIND(name) name##_avx512
#define LOOP __attribute__((target("avx512f,avx512vl,avx512dq,avx512bw,avx2,fma,f16c" PREFERRED)))
#include "loops.h"
#undef REGISTER
#undef KIND
#undef LOOP
#define REGISTER 32
#define KIND(name) name##_avx2
#define LOOP __attribute__((target("avx2,fma,f16c")))
#include "loops.h"
#undef REGISTER
#undef KIND
#undef LOOP
#endif
#define REGISTER 0
#define KIND(name) name##_any
#define LOOP
#include "loops.h"

/* The loops for the processor that this runs on. */
static struct {
    const char *name;
    __typeof__(distances_any) *distances;
    __typeof__(add_rows_any) *add_rows;
    __typeof__(largest_any) *largest;
    __typeof__(add_products_any) *add_products;
    __typeof__(parts_any) *parts;
    __typeof__(covariance_any) *covariance;
    __typeof__(eigenpairs_any) *eigenpairs;
    __typeof__(eigenpairs_again_any) *eigenpairs_again;
    __typeof__(compare_any) *compare;
    __typeof__(scores_any) *scores;
    __typeof__(follow_phase_any) *follow_phase;
    __typeof__(moving_any) *moving;
    __typeof__(steps_any) *steps;
    __typeof__(extremes_any) *extremes;
} loops;

#define CHOOSE(kind)                                                                                                    \
    do {                                                                                                                \
        loops.name = #kind;                                                                                             \
        loops.distances = distances_##kind;                                                                             \
        loops.add_rows = add_rows_##kind;                                                                               \
        loops.largest = largest_##kind;                                                                                 \
        loops.add_products = add_products_##kind;                                                                       \
        loops.parts = parts_##kind;                                                                                     \
        loops.covariance = covariance_##kind;                                                                           \
        loops.eigenpairs = eigenpairs_##kind;                                                                           \
        loops.eigenpairs_again = eigenpairs_again_##kind;                                                               \
        loops.compare = compare_##kind;                                                                                 \
        loops.scores = scores_##kind;                                                                                   \
        loops.follow_phase = follow_phase_##kind;                                                                       \
        loops.moving = moving_##kind;                                                                                   \
        loops.steps = steps_##kind;                                                                                     \
        loops.extremes = extremes_##kind;                                                                               \
    } while (0)

#if defined(WIDE_REGISTERS)
/* Whether the processor can widen halves: __builtin_cpu_supports knows the name in recent compilers only. */
static int can_widen(void) {
    unsigned int a, b, c, d;
    return __get_cpuid(1, &a, &b, &c, &d) && (c & bit_F16C) != 0;
}
#endif

/* Whether the processor has the instructions of a kind of loops. */
static int can(const char *kind) {
#if defined(WIDE_REGISTERS)
    __builtin_cpu_init();
    const int avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && can_widen();
    if (strcmp(kind, "avx2") == 0) {
        return avx2;
    }
    if (strcmp(kind, "avx512") == 0) {
        return avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
               __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw");
    }
#endif
    return strcmp(kind, "any") == 0;
}

/* Use one kind of loops from now on; -1 if this machine has no such kind. */
static int choose(const char *kind) {
    if (!can(kind)) {
        return -1;
    }
#if defined(WIDE_REGISTERS)
    if (strcmp(kind, "avx512") == 0) {
        CHOOSE(avx512);
        return 0;
    }
    if (strcmp(kind, "avx2") == 0) {
        CHOOSE(avx2);
        return 0;
    }
#endif
    CHOOSE(any);
    return 0;
}

/* numpy's type of an index. */
#if defined(_WIN64)
#define INDEX "q"
#else
#define INDEX "l"
#endif

/* ---- arguments ---------------------------------------------------------------------------------------------------*/

/* An argument: its name, numpy's type of its numbers, and its shape, a letter or digit for each dimension. Where a letter
 * stands again the length must be the same, a star stands for any; an argument without dimensions is a number. */
typedef struct {
    const char *name, *type, *shape;
    int how;
} Wanted;
#define WRITTEN 1
/* Between rows there may be room. */
#define ROOM 2

/* Arguments as they came: arrays held, numbers read, and the lengths that the letters stand for. */
typedef struct {
    int count;
    Py_buffer held[MAX_ARGUMENTS];
    const char *begin[MAX_ARGUMENTS], *end[MAX_ARGUMENTS]; /* its bytes, those between rows too; none if it holds nothing */
    double number[MAX_ARGUMENTS];
    Py_ssize_t length[128];
} Taken;

static int expect(const char *name, Py_ssize_t expected, Py_ssize_t got) {
    if (expected != got) {
        PyErr_Format(PyExc_ValueError, "%s: expected %zd, got %zd", name, expected, got);
        return -1;
    }
    return 0;
}

static int expect_most(const char *name, Py_ssize_t most, Py_ssize_t got) {
    if (got < 1 || got > most) {
        PyErr_Format(PyExc_ValueError, "%s: expected 1 to %zd, got %zd", name, most, got);
        return -1;
    }
    return 0;
}

static int expect_arguments(Py_ssize_t expected, Py_ssize_t got) {
    if (expected != got) {
        PyErr_Format(PyExc_TypeError, "expected %zd arguments, got %zd", expected, got);
        return -1;
    }
    return 0;
}

static void let_go(Taken *taken) {
    for (int i = 0; i < taken->count; i++) {
        PyBuffer_Release(&taken->held[i]); /* no effect on a buffer that is not held */
    }
}

/* Whether a held array has the wanted dimensions and type, and its numbers side by side where they must be. */
static int fits(const Py_buffer *held, const Wanted *wanted) {
    const int dimensions = (int)strlen(wanted->shape);
    if (held->ndim != dimensions || held->format == NULL || strcmp(held->format, wanted->type) != 0) {
        PyErr_Format(PyExc_ValueError, "%s: expected %d dimensions of type %s, got %d of %s", wanted->name, dimensions,
                     wanted->type, held->ndim, held->format ? held->format : "B");
        return 0;
    }
    if ((uintptr_t)held->buf % (size_t)held->itemsize != 0) {
        PyErr_Format(PyExc_ValueError, "%s: expected numbers that begin at multiples of their size", wanted->name);
        return 0;
    }
    Py_ssize_t apart = held->itemsize;
    for (int i = dimensions - 1; i >= 0; i--) {
        const Py_ssize_t stride = held->strides[i];
        const int room = (wanted->how & ROOM) && i == 0 && stride > apart && stride % held->itemsize == 0;
        if (held->shape[i] > 1 && stride != apart && !room) {
            PyErr_Format(PyExc_ValueError, "%s: expected numbers side by side, got some %zd bytes apart", wanted->name,
                         stride);
            return 0;
        }
        apart *= held->shape[i];
    }
    return 1;
}

/* Whether an array's lengths are those of the letters so far; new letters stand for its lengths from now on. */
static int agrees(Taken *taken, const Py_buffer *held, const Wanted *wanted) {
    for (int i = 0; i < held->ndim; i++) {
        const unsigned char letter = (unsigned char)wanted->shape[i] & 127;
        if (letter == '*') {
            continue;
        }
        if (letter >= '0' && letter <= '9') {
            taken->length[letter] = letter - '0';
        } else if (taken->length[letter] < 0) {
            taken->length[letter] = held->shape[i];
        }
        if (expect(wanted->name, taken->length[letter], held->shape[i]) < 0) {
            return 0;
        }
    }
    return 1;
}

/* Take arguments; in either case they must be let go afterwards. */
static int take(Taken *taken, const Wanted *wanted, int count, PyObject *const *arguments, Py_ssize_t given) {
    taken->count = 0;
    memset(taken->length, -1, sizeof taken->length);
    if (expect_arguments(count, given) < 0) {
        return -1;
    }
    for (int i = 0; i < count; i++) {
        Py_buffer *held = &taken->held[taken->count++];
        held->obj = NULL;
        taken->begin[i] = taken->end[i] = NULL;
        if (wanted[i].shape[0] == 0) {
            taken->number[i] = PyFloat_AsDouble(arguments[i]);
            if (taken->number[i] == -1.0 && PyErr_Occurred()) {
                return -1;
            }
        } else if (PyObject_GetBuffer(arguments[i], held,
                                      PyBUF_STRIDES | PyBUF_FORMAT | (wanted[i].how & WRITTEN ? PyBUF_WRITABLE : 0)) < 0 ||
                   !fits(held, &wanted[i]) || !agrees(taken, held, &wanted[i])) {
            return -1;
        } else if (held->len > 0) {
            taken->begin[i] = held->buf;
            taken->end[i] = taken->begin[i] + held->len;
            if (wanted[i].how & ROOM) {
                taken->end[i] += (held->shape[0] - 1) * (held->strides[0] - held->len / held->shape[0]);
            }
        }
    }
    /* Inputs and outputs must not overlap: indices could change after they were checked. */
    for (int i = 0; i < count; i++) {
        for (int j = 0; j < count && wanted[i].how & WRITTEN; j++) {
            if (i != j && taken->begin[i] < taken->end[j] && taken->begin[j] < taken->end[i]) {
                PyErr_Format(PyExc_ValueError, "%s: expected memory that is in no other array", wanted[i].name);
                return -1;
            }
        }
    }
    return 0;
}

#define COUNT(wanted) (int)(sizeof(wanted) / sizeof(wanted)[0])
#define TAKE(taken, wanted) take(taken, wanted, COUNT(wanted), arguments, given)

/* A function of the module, by how it runs with arguments that were taken. */
#define CALL(name)                                                                                                      \
    static PyObject *name(PyObject *module, PyObject *const *arguments, Py_ssize_t given) {                             \
        Taken taken;                                                                                                    \
        (void)module;                                                                                                   \
        PyObject *result = TAKE(&taken, name##_wanted) == 0 ? name##_run(&taken) : NULL;                                \
        let_go(&taken);                                                                                                 \
        return result;                                                                                                  \
    }

static Py_ssize_t stride_of(const Py_buffer *held) { return held->strides[0] / held->itemsize; }

static int expect_indices(const char *name, const Py_buffer *held, Py_ssize_t below) {
    const Py_ssize_t *indices = held->buf;
    for (Py_ssize_t i = 0; i < held->len / held->itemsize; i++) {
        if (indices[i] < 0 || indices[i] >= below) {
            PyErr_Format(PyExc_ValueError, "%s: expected indices below %zd, got %zd", name, below, indices[i]);
            return -1;
        }
    }
    return 0;
}

/* ---- a hop's loops ------------------------------------------------------------------------------------------------*/

/* library.distances.DistanceMeasurer.measure: measure_distances(positions, pairs, rows) */
static const Wanted measure_distances_wanted[] = {
    {"positions", "d", "fj3", 0}, {"pairs", INDEX, "p2", 0}, {"rows", "d", "fp", WRITTEN | ROOM}};
static PyObject *measure_distances_run(Taken *taken) {
    PyObject *result = NULL;
    if (expect_most("joints", MAX_JOINTS, taken->length['j']) == 0 &&
        expect_indices("pairs", &taken->held[1], taken->length['j']) == 0) {
        loops.distances(taken->held[0].buf, taken->length['f'], taken->length['j'], taken->held[1].buf, taken->length['p'],
                        taken->held[2].buf, stride_of(&taken->held[2]));
        result = Py_NewRef(Py_None);
    }
    return result;
}
CALL(measure_distances)

/* stream.recognizer.windows.sliding_window.Change: rows that entered a span, from `entered` to before `end`, and rows that
 * left it, from `left` to before `gone`; and how many are in it. */
typedef struct {
    Py_ssize_t entered, end, left, gone, count;
} Change;

/* stream.recognizer.windows.sliding_window.Span.take_change; arguments 1 and 2 are times and places, and the last four
 * seconds, most, end and moved. -1 and an error where they do not fit. */
static int take_change(const Taken *taken, Change *change) {
    const double *times = taken->held[1].buf, *number = taken->number + taken->count - 4;
    Py_ssize_t *places = taken->held[2].buf;
    const Py_ssize_t room = taken->length['n'];
    if (!(number[1] >= 1 && number[2] >= 0 && number[2] <= (double)room && number[3] >= 0 && number[3] < 1e15)) {
        PyErr_Format(PyExc_ValueError, "end: expected 0 to %zd, moved not below 0, and most 1 at least", room);
        return -1;
    }
    const Py_ssize_t end = (Py_ssize_t)number[2], moved = (Py_ssize_t)number[3], last = end - 1;
    *change = (Change){0};
    if (end == 0) {
        return 0;
    }
    Py_ssize_t left = places[0] > moved ? places[0] - moved : 0, entered = places[1] > moved ? places[1] - moved : 0;
    left = left < last ? left : last;
    entered = entered < end ? entered : end;
    Py_ssize_t start = left;
    const double too_old = times[last] - number[0];
    while (start < last && (times[start] <= too_old || (double)(last - start) >= number[1])) {
        start++;
    }
    places[0] = start + moved;
    places[1] = end + moved;
    *change = (Change){.entered = entered > start ? entered : start, .end = end, .left = left,
                       .gone = entered < start ? entered : start, .count = end - start};
    change->gone = change->gone > left ? change->gone : left;
    return 0;
}

/* What stream.recognizer.windows.rolling does of one window: it adds rows that entered and subtracts rows that left, or all
 * anew; and says how large the sum of squares is that bounds the rounding, and the sum that belongs to it. */
typedef struct {
    const double *rows, *times;
    Py_ssize_t stride, width;
    double *drift, *reference, *sum, *clock, *products; /* moments have a clock, covariances products */
} Sums;

static void add(const Sums *sums, Py_ssize_t begin, Py_ssize_t end, double weight) {
    const double *rows = sums->rows + begin * sums->stride;
    if (sums->clock != NULL) {
        loops.add_rows(sums->reference, sums->width, sums->clock, rows, sums->stride, sums->times + begin, end - begin, weight);
    } else {
        loops.add_products(sums->reference, sums->sum, sums->products, (int)sums->width, rows, sums->stride, end - begin, weight);
    }
}

/* The variance, times the rows, that is left where the sum of squares is largest; gives this sum of squares too. */
static double scatter_of(const Sums *sums, double count, double *largest) {
    double square = 0.0;
    *largest = 0.0;
    if (sums->clock != NULL) {
        const Py_ssize_t place = loops.largest(sums->sum + 2 * sums->width, sums->width);
        *largest = sums->sum[2 * sums->width + place];
        square = sums->sum[place] * sums->sum[place];
    } else {
        for (Py_ssize_t i = 0; i < sums->width; i++) {
            *largest += sums->products[i * sums->width + i];
            square += sums->sum[i] * sums->sum[i];
        }
    }
    return fmax(*largest - square / count, count * sums->drift[1]);
}

/* Forget all sums; the mean of the rows becomes the reference. */
static void begin_anew(const Sums *sums, Py_ssize_t begin, Py_ssize_t end) {
    const Py_ssize_t width = sums->width;
    double mean = 0.0, square = 0.0;
    memset(sums->reference, 0, sizeof(double) * (size_t)width);
    for (Py_ssize_t row = begin; row < end; row++) {
        for (Py_ssize_t i = 0; i < width; i++) {
            sums->reference[i] += sums->rows[row * sums->stride + i];
        }
    }
    for (Py_ssize_t i = 0; i < width; i++) {
        sums->reference[i] /= (double)(end - begin);
        mean += sums->reference[i] / (double)width;
        square += sums->reference[i] * sums->reference[i];
    }
    memset(sums->sum, 0, sizeof(double) * (size_t)(sums->clock != NULL ? 3 * width : width));
    if (sums->clock != NULL) {
        sums->clock[0] = sums->times[end - 1];
        sums->clock[1] = sums->clock[2] = 0.0;
    } else {
        memset(sums->products, 0, sizeof(double) * (size_t)(width * width));
    }
    sums->drift[0] = 0.0;
    sums->drift[1] = NO_MOVEMENT * NO_MOVEMENT * (sums->clock != NULL ? mean * mean : square);
}

/* stream.recognizer.windows.rolling.Rolling.update; gives whether the sums were computed afresh. */
static PyObject *update(const Sums *sums, const Change *change) {
    const Py_ssize_t new = change->end - change->entered, start = change->end - change->count;
    int afresh = new > 0 && new == change->count;
    double largest;
    if (new > 0 && !afresh) {
        add(sums, change->entered, change->end, 1.0);
        add(sums, change->left, change->gone, -1.0);
        const double scatter = scatter_of(sums, (double)change->count, &largest);
        sums->drift[0] += DBL_EPSILON * (double)(new + change->gone - change->left) * largest;
        afresh = sums->drift[0] > DRIFT_TOLERANCE * scatter;
    }
    if (afresh) {
        begin_anew(sums, start, change->end);
        add(sums, start, change->end, 1.0);
        scatter_of(sums, (double)change->count, &largest);
        sums->drift[0] = DBL_EPSILON * (double)change->count * largest;
    }
    return PyBool_FromLong(afresh);
}

/* stream.recognizer.windows.rolling.RollingMoments: follow(rows, times, places, drift, sums, clock, seconds, most, end, moved)
 * -> whether the sums were computed afresh */
static const Wanted follow_wanted[] = {
    {"rows", "d", "nw", ROOM},     {"times", "d", "n", 0},       {"places", INDEX, "2", WRITTEN},
    {"drift", "d", "2", WRITTEN},  {"sums", "d", "4w", WRITTEN}, {"clock", "d", "3", WRITTEN},
    {"seconds", "d", "", 0},       {"most", "d", "", 0},         {"end", "d", "", 0},
    {"moved", "d", "", 0}};
static PyObject *follow_run(Taken *taken) {
    Change change;
    PyObject *result = NULL;
    if (expect_most("rows", PY_SSIZE_T_MAX, taken->length['w']) == 0 && take_change(taken, &change) == 0) {
        const Py_buffer *held = taken->held;
        const Py_ssize_t width = taken->length['w'];
        double *sums = held[4].buf;
        result = update(&(Sums){.rows = held[0].buf, .times = held[1].buf, .stride = stride_of(&held[0]), .width = width,
                                .drift = held[3].buf, .reference = sums, .sum = sums + width, .clock = held[5].buf},
                        &change);
    }
    return result;
}

/* stream.recognizer.windows.rolling.RollingCovariance: follow_products(points, times, places, drift, reference, sum, products,
 * seconds, most, end, moved) -> whether the sums were computed afresh */
static const Wanted follow_products_wanted[] = {
    {"points", "d", "nw", ROOM},      {"times", "d", "n", 0},           {"places", INDEX, "2", WRITTEN},
    {"drift", "d", "2", WRITTEN},     {"reference", "d", "w", WRITTEN}, {"sum", "d", "w", WRITTEN},
    {"products", "d", "ww", WRITTEN}, {"seconds", "d", "", 0},          {"most", "d", "", 0},
    {"end", "d", "", 0},              {"moved", "d", "", 0}};
static PyObject *follow_products_run(Taken *taken) {
    Change change;
    PyObject *result = NULL;
    if (expect_most("directions", MAX_DIRECTIONS, taken->length['w']) == 0 && take_change(taken, &change) == 0) {
        const Py_buffer *held = taken->held;
        result = update(&(Sums){.rows = held[0].buf, .times = held[1].buf, .stride = stride_of(&held[0]),
                                .width = taken->length['w'], .drift = held[3].buf, .reference = held[4].buf,
                                .sum = held[5].buf, .products = held[6].buf},
                        &change);
    }
    return result;
}

/* RollingMoments.read, library.windows.parts.spread, posture, trend and movement:
 * read_parts(sums, clock, places, sizing, segments, above, ends, floor, level, spread, posture, trend) -> (movement, the body's
 * size); posture and trend may be empty: not wanted */
static const Wanted read_parts_wanted[] = {
    {"sums", "d", "4w", 0},         {"clock", "d", "3", 0},         {"places", INDEX, "2", 0},
    {"sizing", "d", "w", 0},        {"segments", INDEX, "s", 0},    {"above", "d", "sj", 0},
    {"ends", "B", "3w", 0},         {"floor", "d", "", 0},          {"level", "d", "", 0},
    {"spread", "d", "w", WRITTEN},  {"posture", "d", "p", WRITTEN}, {"trend", "d", "t", WRITTEN}};
static PyObject *read_parts_run(Taken *taken) {
    PyObject *result = NULL;
    if (expect_most("sums", PY_SSIZE_T_MAX, taken->length['w']) == 0 &&
        (taken->length['s'] == 0 || expect_most("joints", MAX_JOINTS, taken->length['j']) == 0) &&
        expect_indices("segments", &taken->held[4], taken->length['w']) == 0 &&
        (taken->length['p'] == 0 || expect("posture", taken->length['w'], taken->length['p']) == 0) &&
        (taken->length['t'] == 0 || expect("trend", taken->length['w'], taken->length['t']) == 0)) {
        Py_buffer *held = taken->held;
        const Py_ssize_t *places = held[2].buf;
        double movement;
        const double size = loops.parts(held[0].buf, taken->length['w'], held[1].buf, (double)places[1] - (double)places[0], held[3].buf,
                                        held[4].buf, taken->length['s'], held[5].buf, taken->length['j'], held[6].buf,
                                        taken->number[7], taken->number[8], held[9].buf, taken->length['p'] > 0 ? held[10].buf : NULL,
                                        taken->length['t'] > 0 ? held[11].buf : NULL, &movement);
        result = Py_BuildValue("dd", movement, size);
    }
    return result;
}

static int expect_eigenpairs(Py_ssize_t size, Py_ssize_t most) {
    return expect_most("directions", MAX_DIRECTIONS, size) == 0 &&
                   expect_most("values", size < EIGENVECTORS ? size : EIGENVECTORS, most) == 0
               ? 0
               : -1;
}

/* library.windows.cutting.eigenpairs_of: eigenpairs(covariances, values, vectors) -> whether all were found */
static const Wanted eigenpairs_wanted[] = {
    {"covariances", "d", "cnn", 0}, {"values", "d", "ck", WRITTEN}, {"vectors", "d", "ckn", WRITTEN}};
static PyObject *eigenpairs_run(Taken *taken) {
    PyObject *result = NULL;
    if (expect_eigenpairs(taken->length['n'], taken->length['k']) == 0) {
    const int size = (int)taken->length['n'], count = (int)taken->length['k'];
    const double *covariances = taken->held[0].buf;
    double *values = taken->held[1].buf, *vectors = taken->held[2].buf;
    int found = 1;
    for (Py_ssize_t c = 0; c < taken->length['c'] && found; c++) {
    found = loops.eigenpairs(covariances + c * size * size, size, count, values + c * count, vectors + c * count * size);
    }
    result = PyBool_FromLong(found);
    }
    return result;
    }
    CALL(eigenpairs)
    
    /* RollingCovariance.read, library.windows.cutting.eigenpairs_of and library.windows.parts.eigen:
    * read_eigen(sum, products, places, drift, values, vectors, scaled, block) -> the covariance's trace */
    static const Wanted read_eigen_wanted[] = {{"sum", "d", "n", 0},           {"products", "d", "nn", 0},     {"places", INDEX, "2", 0},
    {"drift", "d", "2", 0},         {"values", "d", "k", WRITTEN},  {"vectors", "d", "kn", WRITTEN},
    {"scaled", "d", "kn", WRITTEN}, {"block", "d", "n8", WRITTEN}};
static PyObject *read_eigen_run(Taken *taken) {
    PyObject *result = NULL;
    if (expect_eigenpairs(taken->length['n'], taken->length['k']) == 0) {
        const int size = (int)taken->length['n'], most = (int)taken->length['k'];
        double covariance[MAX_DIRECTIONS * MAX_DIRECTIONS], total = 0.0;
        double *values = taken->held[4].buf, *vectors = taken->held[5].buf, *scaled = taken->held[6].buf;
        const Py_ssize_t *places = taken->held[2].buf;
        const double *drift = taken->held[3].buf;
        const double trace = loops.covariance(taken->held[0].buf, taken->held[1].buf, size, (double)places[1] - (double)places[0], drift[1],
                                              covariance);
        if (loops.eigenpairs_again(covariance, size, most, trace, values, vectors, taken->held[7].buf)) {
            for (int k = 0; k < most; k++) {
                total += values[k] > 0.0 ? values[k] : 0.0;
            }
            for (int k = 0; k < most; k++) {
                const double root = values[k] > 0.0 ? sqrt(sqrt(values[k] / total)) : 0.0;
                for (int i = 0; i < size; i++) {
                    scaled[k * size + i] = root * vectors[k * size + i];
                }
            }
            result = PyFloat_FromDouble(trace);
        } else {
            PyErr_SetString(PyExc_ValueError, "products: expected finite numbers");
        }
    }
    return result;
}

/* stream.recognizer.progress._Filter.step: follow_phase(course, indices, starts, vectors, lengths, expected, constants, live,
 * belief, after, room, told). The rows of `course` are phases, beginning, rounds and alike; those of `indices` bins and
 * order; `constants` are stay, one, two, changes, begins, again, sharpness and near. */
static const Wanted follow_phase_wanted[] = {
    {"course", "d", "4n", 0},     {"indices", INDEX, "2n", 0},  {"starts", INDEX, "r", 0},
    {"vectors", "f", "wn", 0},    {"lengths", "f", "n", 0},     {"expected", "d", "kn", 0},
    {"constants", "d", "8", 0},   {"live", "f", "w", 0},        {"belief", "d", "n", WRITTEN},
    {"after", "d", "n", WRITTEN}, {"room", "f", "m", WRITTEN}, {"told", "d", "t", WRITTEN}};
static PyObject *follow_phase_run(Taken *taken) {
    PyObject *result = NULL;
    if (expect_most("moments", MAX_WINDOWS, taken->length['n']) == 0 &&
        expect_most("recordings", taken->length['n'], taken->length['r']) == 0 &&
        expect("room", taken->length['n'] + MAX_FLOATS, taken->length['m']) == 0 &&
        expect("told", taken->length['k'] + 2, taken->length['t']) == 0 &&
        expect_indices("starts", &taken->held[2], taken->length['n']) == 0) {
        const Py_buffer *held = taken->held;
        const Py_ssize_t count = taken->length['n'];
        const double *numbers = held[0].buf, *constants = held[6].buf;
        const Py_ssize_t *indices = held[1].buf, *starts = held[2].buf;
        const Course course = {
            .count = count,
            .recordings = taken->length['r'],
            .axes = taken->length['w'],
            .rows = taken->length['k'],
            .phases = numbers,
            .beginning = numbers + count,
            .rounds = numbers + 2 * count,
            .alike = numbers + 3 * count,
            .bins = indices,
            .order = indices + count,
            .starts = starts,
            .vectors = held[3].buf,
            .lengths = held[4].buf,
            .expected = held[5].buf,
            .stay = constants[0],
            .one = constants[1],
            .two = constants[2],
            .changes = constants[3],
            .begins = constants[4],
            .again = constants[5],
            .sharpness = constants[6],
            .near = constants[7],
        };
        int right = starts[0] == 0;
        for (Py_ssize_t r = 1; r < course.recordings; r++) {
            right = right && starts[r] > starts[r - 1];
        }
        for (Py_ssize_t i = 0; i < count; i++) {
            right = right && indices[i] >= 0 && indices[i] < MAX_BINS && indices[count + i] >= 0 && indices[count + i] < count;
        }
        if (right) {
            loops.follow_phase(&course, held[7].buf, held[8].buf, held[9].buf, held[10].buf, held[11].buf);
            result = Py_NewRef(Py_None);
        } else {
            PyErr_Format(PyExc_ValueError, "indices: expected bins below %d, an order, and starts that ascend from 0", MAX_BINS);
        }
    }
    return result;
}
CALL(follow_phase)

/* stream.recognizer.progress._moving: moving(points, back, factor, whitening, live) -> (the squared length of the velocity,
 * the summed variance of the points) */
static const Wanted moving_wanted[] = {
    {"points", "d", "pd", ROOM},   {"back", "d", "", 0},     {"factor", "d", "", 0},
    {"whitening", "d", "vw", 0}, {"live", "f", "w", WRITTEN}};
static PyObject *moving_run(Taken *taken) {
    PyObject *result = NULL;
    if (expect_most("points", MAX_WINDOWS, taken->length['p']) == 0 &&
        expect_most("directions", MAX_DIRECTIONS, taken->length['d']) == 0 &&
        expect("whitening", 2 * taken->length['d'], taken->length['v']) == 0) {
        const Py_ssize_t count = taken->length['p'];
        if (taken->number[1] >= 0 && taken->number[1] < (double)count) {
            double square, variance;
            loops.moving(taken->held[0].buf, count, stride_of(&taken->held[0]), taken->length['d'], (Py_ssize_t)taken->number[1],
                         taken->number[2], taken->held[3].buf, taken->length['w'], taken->held[4].buf, &square, &variance);
            result = Py_BuildValue("dd", square, variance);
        } else {
            PyErr_Format(PyExc_ValueError, "back: expected 0 to %zd", count - 1);
        }
    }
    return result;
}
CALL(moving)

/* stream.recognizer.joints.plausibility.steps_of: steps(positions, last, steps) -> the largest sum of squares */
static const Wanted steps_wanted[] = {
    {"positions", "d", "fj3", 0}, {"last", "d", "j3", 0}, {"steps", "d", "fj3", WRITTEN}};
static PyObject *steps_run(Taken *taken) {
    Py_buffer *held = taken->held;
    return PyFloat_FromDouble(loops.steps(held[0].buf, taken->length['f'], taken->length['j'], held[1].buf, held[2].buf));
    }
    CALL(steps)
    
    /* stream.recognizer.joints.plausibility.extremes_of: extremes(looks, ends, lengths, moved) */
    static const Wanted extremes_wanted[] = {
    {"looks", "d", "fj3", 0}, {"ends", INDEX, "s2", 0}, {"lengths", "d", "2s", WRITTEN}, {"moved", "d", "j", WRITTEN}};
static PyObject *extremes_run(Taken *taken) {
    PyObject *result = NULL;
    if (expect_indices("ends", &taken->held[1], taken->length['j']) == 0) {
        Py_buffer *held = taken->held;
        loops.extremes(held[0].buf, taken->length['f'], taken->length['j'], held[1].buf, taken->length['s'], held[2].buf,
                       held[3].buf);
        result = Py_NewRef(Py_None);
    }
    return result;
}
CALL(extremes)

/* ---- calls with their arrays bound --------------------------------------------------------------------------------*/

/* What is called at every hop with the same arrays: numpy takes longer to hand them out than some loops take. */
typedef struct {
    const char *name;
    PyObject *(*run)(Taken *);
    const Wanted *wanted;
    int count;
} Called;
#define CALLED(name) {#name, name##_run, name##_wanted, COUNT(name##_wanted)}
static const Called called[] = {CALLED(follow), CALLED(follow_products), CALLED(read_parts), CALLED(read_eigen)};

typedef struct {
    PyObject_HEAD
    const Called *called;
    Taken taken;
} Bound;

static void bound_dealloc(PyObject *self) {
    PyTypeObject *type = Py_TYPE(self);
    let_go(&((Bound *)self)->taken);
    ((freefunc)PyType_GetSlot(type, Py_tp_free))(self);
    Py_DECREF(type);
}

/* Bound(name, ...): a function's name and its arguments */
static PyObject *bound_new(PyTypeObject *type, PyObject *tuple, PyObject *named) {
    const Py_ssize_t given = PyTuple_Size(tuple) - 1;
    const char *name = given >= 0 ? PyUnicode_AsUTF8AndSize(PyTuple_GetItem(tuple, 0), NULL) : "";
    PyObject *arguments[MAX_ARGUMENTS] = {NULL};
    if (name == NULL || (named != NULL && expect_arguments(0, PyDict_Size(named)) < 0)) {
        return NULL;
    }
    for (Py_ssize_t i = 0; i < given && i < MAX_ARGUMENTS; i++) {
        arguments[i] = PyTuple_GetItem(tuple, i + 1);
    }
    for (int c = 0; c < COUNT(called); c++) {
        if (strcmp(name, called[c].name) == 0) {
            Bound *bound = (Bound *)((allocfunc)PyType_GetSlot(type, Py_tp_alloc))(type, 0);
            if (bound != NULL && take(&bound->taken, called[c].wanted, called[c].count, arguments, given) < 0) {
                Py_CLEAR(bound);
            } else if (bound != NULL) {
                bound->called = &called[c];
            }
            return (PyObject *)bound;
        }
    }
    return PyErr_Format(PyExc_ValueError, "name: expected a function of every hop, got %s", name);
}

/* run(...): numbers instead of the last of the arguments */
static PyObject *bound_run(PyObject *self, PyObject *const *arguments, Py_ssize_t given) {
    Bound *bound = (Bound *)self;
    const Py_ssize_t begin = bound->taken.count - given;
    for (Py_ssize_t i = 0; i < given; i++) {
        if (begin < 0 || bound->called->wanted[begin + i].shape[0] != 0) {
            PyErr_SetString(PyExc_TypeError, "run: expected numbers only");
            return NULL;
        }
        bound->taken.number[begin + i] = PyFloat_AsDouble(arguments[i]);
        if (bound->taken.number[begin + i] == -1.0 && PyErr_Occurred()) {
            return NULL;
        }
    }
    return bound->called->run(&bound->taken);
}

/* ---- windows compared: library.windows.index.WindowIndex ----------------------------------------------------------*/

/* Give zeros that begin with a cache line; NULL and an error when there is no memory. */
static void *zeros(Table *table, Py_ssize_t count, size_t bytes) {
    void *block = table->blocks_owned < MAX_OWNED ? PyMem_Calloc((size_t)count + LINE, bytes) : NULL;
    if (block == NULL) {
        return PyErr_NoMemory();
    }
    table->owned[table->blocks_owned++] = block;
    return (char *)block + (LINE - (uintptr_t)block % LINE) % LINE;
}

static void table_dealloc(PyObject *self) {
    Table *table = (Table *)self;
    PyTypeObject *type = Py_TYPE(self);
    while (table->blocks_owned > 0) {
        PyMem_Free(table->owned[--table->blocks_owned]);
    }
    ((freefunc)PyType_GetSlot(type, Py_tp_free))(self);
    Py_DECREF(type);
}

/* Take over starts, ascending from 0, and set the end of the last. */
static Py_ssize_t *take_starts(Table *table, const Py_buffer *starts, const char *name, Py_ssize_t end, Py_ssize_t *count) {
    *count = starts->shape[0];
    Py_ssize_t *taken = expect_most(name, end, *count) < 0 ? NULL : zeros(table, *count + 1, sizeof(Py_ssize_t));
    if (taken == NULL) {
        return NULL;
    }
    memcpy(taken, starts->buf, sizeof(Py_ssize_t) * (size_t)*count);
    taken[*count] = end;
    for (Py_ssize_t i = 0; i < *count; i++) {
        if (taken[0] != 0 || taken[i] >= taken[i + 1]) {
            PyErr_Format(PyExc_ValueError, "%s: expected to start at 0 and ascend below %zd", name, end);
            return NULL;
        }
    }
    return taken;
}

/* Lay numbers (windows, columns) out, lane by lane of windows. */
static void *take_lanes(Table *table, const Py_buffer *numbers) {
    const Py_ssize_t columns = numbers->shape[1], bytes = numbers->itemsize;
    char *taken = zeros(table, table->lanes * columns * LANE, (size_t)bytes);
    for (Py_ssize_t row = 0; taken != NULL && row < table->windows; row++) {
        for (Py_ssize_t k = 0; k < columns; k++) {
            memcpy(taken + ((row / LANE * columns + k) * LANE + row % LANE) * bytes,
                   (char *)numbers->buf + (row * columns + k) * bytes, (size_t)bytes);
        }
    }
    return taken;
}

/* Take over a metric's origin (numbers) and axes (numbers, kept); one that keeps nothing is none. */
static int take_metric(Table *table, Metric *metric, const Py_buffer *origin, const Py_buffer *axes) {
    const Py_ssize_t numbers = axes->shape[0], kept = axes->shape[1], stride = (kept + LANE - 1) / LANE * LANE;
    if (kept == 0) {
        return 0;
    }
    if (expect_most("axes", MAX_AXES, kept) < 0 || expect_most("numbers", MAX_NUMBERS, numbers) < 0 ||
        (metric->origin = zeros(table, numbers, sizeof(float))) == NULL ||
        (metric->axes = zeros(table, numbers * stride, sizeof(Half))) == NULL) {
        return -1;
    }
    metric->numbers = numbers;
    metric->kept = kept;
    metric->stride = stride;
    memcpy(metric->origin, origin->buf, sizeof(float) * (size_t)numbers);
    for (Py_ssize_t i = 0; i < numbers; i++) {
        memcpy(metric->axes + i * stride, (Half *)axes->buf + i * kept, sizeof(Half) * (size_t)kept);
    }
    return 0;
}

/* Table(the windows' leading eigenvectors, block starts, class starts, weights, nearest) */
static PyObject *table_new(PyTypeObject *type, PyObject *tuple, PyObject *named) {
    static const Wanted wanted[] = {{"windows", "f", "wd", 0}, {"blocks", INDEX, "b", 0}, {"classes", INDEX, "c", 0},
                                    {"weights", "f", "vg", 0}, {"nearest", "d", "", 0}};
    const Py_ssize_t given = PyTuple_Size(tuple);
    PyObject *arguments[5] = {NULL};
    Taken taken;
    for (Py_ssize_t i = 0; i < given && i < 5; i++) {
        arguments[i] = PyTuple_GetItem(tuple, i);
    }
    Table *table = NULL;
    if (TAKE(&taken, wanted) == 0 && (named == NULL || expect_arguments(0, PyDict_Size(named)) == 0) &&
        expect_most("windows", MAX_WINDOWS, taken.length['w']) == 0 &&
        expect_most("directions", MAX_AXES, taken.length['d']) == 0 &&
        expect_most("groups", MAX_PARTS, taken.length['g']) == 0 && expect_most("views", MAX_VIEWS, taken.length['v']) == 0) {
        table = (Table *)((allocfunc)PyType_GetSlot(type, Py_tp_alloc))(type, 0);
    }
    if (table != NULL) {
        Py_buffer *held = taken.held;
        table->windows = taken.length['w'];
        table->directions = taken.length['d'];
        table->lanes = (table->windows + LANE - 1) / LANE;
        table->nearest = (float)taken.number[4];
        table->wanted = taken.length['g'];
        table->views = (int)taken.length['v'];
        for (Py_ssize_t v = 0; v < table->views; v++) {
            memcpy(table->weights[v], (float *)held[3].buf + v * table->wanted, sizeof(float) * (size_t)table->wanted);
        }
        if ((table->block_starts = take_starts(table, &held[1], "blocks", table->windows, &table->blocks)) == NULL ||
            (table->class_starts = take_starts(table, &held[2], "classes", table->blocks, &table->classes)) == NULL ||
            (table->eigenvectors = take_lanes(table, &held[0])) == NULL ||
            (table->products = zeros(table, MAX_VIEWS * table->lanes * LANE, sizeof(float))) == NULL ||
            (table->placed = zeros(table, MAX_PARTS * MAX_AXES, sizeof(float))) == NULL ||
            (table->room = zeros(table, MAX_NUMBERS, sizeof(float))) == NULL) {
            Py_CLEAR(table);
        }
    }
    let_go(&taken);
    return (PyObject *)table;
}

/* add_part(eigenvectors, directions, origin, axes): 0 eigenvectors for a part of distances; no axes for eigenvectors that
 * are compared as they are */
static PyObject *table_add_part(PyObject *self, PyObject *const *arguments, Py_ssize_t given) {
    static const Wanted wanted[] = {
        {"eigenvectors", "d", "", 0}, {"directions", "d", "", 0}, {"origin", "f", "n", 0}, {"axes", "e", "nk", 0}};
    Table *table = (Table *)self;
    Taken taken;
    PyObject *result = NULL;
    if (TAKE(&taken, wanted) == 0 && expect_most("parts", MAX_PARTS, table->parts + 1) == 0) {
        const double vectors = taken.number[0], directions = taken.number[1];
        Part *part = &table->part[table->parts];
        memset(part, 0, sizeof *part);
        if (vectors >= 0 && vectors <= EIGENVECTORS && directions >= 0 && directions <= MAX_DIRECTIONS) {
            part->vectors = (Py_ssize_t)vectors;
            part->directions = part->vectors > 0 ? (Py_ssize_t)directions : 0;
        }
        const Py_ssize_t flattened = part->directions * (part->directions + 1) / 2;
        if ((part->directions == 0 ? expect_most("axes", MAX_AXES, taken.length['k'])
                                   : taken.length['k'] > 0 ? expect("origin", flattened, taken.length['n']) : 0) == 0 &&
            take_metric(table, &part->metric, &taken.held[2], &taken.held[3]) == 0) {
            table->parts++;
            result = Py_NewRef(Py_None);
        }
    }
    let_go(&taken);
    return result;
}

/* Set the members of a group; -1 if they make no group. */
static int take_members(const Table *table, Group *group, const Py_buffer *members) {
    if (expect_most("members", MAX_PARTS, members->shape[0]) < 0 || expect_indices("members", members, table->parts) < 0) {
        return -1;
    }
    group->count = (int)members->shape[0];
    for (int m = 0; m < group->count; m++) {
        const Part *part = &table->part[group->members[m] = (int)((Py_ssize_t *)members->buf)[m]];
        group->axes += part->metric.kept;
        group->between = group->between || part->metric.kept == 0;
    }
    if (group->between) {
        group->axes = table->part[group->members[0]].directions;
        return expect("members", 1, group->count);
    }
    return 0;
}

/* add_group(members, origin, axes, windows, lengths): no axes where the parts' vectors are compared as they are */
static PyObject *table_add_group(PyObject *self, PyObject *const *arguments, Py_ssize_t given) {
    static const Wanted wanted[] = {{"members", INDEX, "m", 0},
                                    {"origin", "f", "n", 0},
                                    {"axes", "e", "nk", 0},
                                    {"windows", "e", "wa", 0},
                                    {"lengths", "f", "w", 0}};
    Table *table = (Table *)self;
    Taken taken;
    PyObject *result = NULL;
    if (TAKE(&taken, wanted) == 0 && expect_most("groups", table->wanted, table->groups + 1) == 0) {
        Group *group = &table->group[table->groups];
        Py_buffer *held = taken.held;
        memset(group, 0, sizeof *group);
        if (take_members(table, group, &held[0]) == 0 &&
            (taken.length['k'] == 0 || expect("origin", group->axes, taken.length['n']) == 0) &&
            take_metric(table, &group->joint, &held[1], &held[2]) == 0) {
            group->axes = group->joint.kept > 0 ? group->joint.kept : group->axes;
            if (expect_most("axes", MAX_AXES, group->axes) == 0 &&
                expect("windows", group->axes * (group->between ? EIGENVECTORS : 1), taken.length['a']) == 0 &&
                expect("windows", table->windows, taken.length['w']) == 0 &&
                (group->windows = take_lanes(table, &held[3])) != NULL &&
                (group->lengths = zeros(table, table->lanes * LANE, sizeof(float))) != NULL) {
                for (Py_ssize_t w = 0; w < table->windows; w++) {
                    group->lengths[w] = ((float *)held[4].buf)[w] + table->nearest;
                }
                table->groups++;
                result = Py_NewRef(Py_None);
            }
        }
    }
    let_go(&taken);
    return result;
}

/* compared(numbers, ..., logs): of each part its numbers, or its eigenvectors; logs (views, classes) */
static PyObject *table_compared(PyObject *self, PyObject *const *arguments, Py_ssize_t given) {
    Table *table = (Table *)self;
    Wanted wanted[MAX_PARTS + 1];
    const double *numbers[MAX_PARTS];
    Taken taken;
    PyObject *result = NULL;
    for (int p = 0; p < table->parts; p++) {
        wanted[p] = (Wanted){"numbers", "d", table->part[p].directions > 0 ? "**" : "*", 0};
    }
    wanted[table->parts] = (Wanted){"logs", "d", "vc", WRITTEN};
    if (take(&taken, wanted, table->parts + 1, arguments, given) == 0 &&
        expect("groups", table->wanted, table->groups) == 0 && expect("views", table->views, taken.length['v']) == 0 &&
        expect("classes", table->classes, taken.length['c']) == 0) {
        int right = 1;
        for (int p = 0; p < table->parts && right; p++) {
            const Part *part = &table->part[p];
            const Py_ssize_t *shape = taken.held[p].shape;
            numbers[p] = taken.held[p].buf;
            right = part->directions > 0 ? expect("numbers", part->vectors, shape[0]) == 0 &&
                                               expect("numbers", part->directions, shape[1]) == 0
                                         : expect("numbers", part->metric.numbers, shape[0]) == 0;
        }
        if (right) {
            loops.compare(table, numbers, taken.held[table->parts].buf);
            result = Py_NewRef(Py_None);
        }
    }
    let_go(&taken);
    return result;
}

/* scores(eigenvector, scores): each class's best |inner product| with a leading eigenvector */
static PyObject *table_scores(PyObject *self, PyObject *const *arguments, Py_ssize_t given) {
    static const Wanted wanted[] = {{"eigenvector", "d", "d", 0}, {"scores", "d", "c", WRITTEN}};
    Table *table = (Table *)self;
    Taken taken;
    PyObject *result = NULL;
    if (TAKE(&taken, wanted) == 0 && expect("eigenvector", table->directions, taken.length['d']) == 0 &&
        expect("scores", table->classes, taken.length['c']) == 0) {
        loops.scores(table, taken.held[0].buf, taken.held[1].buf);
        result = Py_NewRef(Py_None);
    }
    let_go(&taken);
    return result;
}

/* ---- which loops -------------------------------------------------------------------------------------------------*/

/* kind() -> the kind in use */
static PyObject *kind(PyObject *module, PyObject *const *arguments, Py_ssize_t given) {
    (void)module, (void)arguments;
    return expect_arguments(0, given) == 0 ? PyUnicode_FromString(loops.name) : NULL;
}

/* use(kind): another kind than the best, for tests */
static PyObject *use(PyObject *module, PyObject *name) {
    (void)module;
    const char *text = PyUnicode_AsUTF8AndSize(name, NULL);
    if (text == NULL) {
        return NULL;
    }
    if (choose(text) < 0) {
        PyErr_Format(PyExc_ValueError, "kind: expected any, avx2 or avx512, as far as this processor has it, got %s", text);
        return NULL;
    }
    return Py_NewRef(Py_None);
}

/* ---- the module ---------------------------------------------------------------------------------------------------*/

#define FUNCTION(function) (PyCFunction)(void (*)(void))(function), METH_FASTCALL, NULL

static PyMethodDef table_methods[] = {
    {"add_part", FUNCTION(table_add_part)},
    {"add_group", FUNCTION(table_add_group)},
    {"compared", FUNCTION(table_compared)},
    {"scores", FUNCTION(table_scores)},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot table_slots[] = {
    {Py_tp_new, table_new},
    {Py_tp_dealloc, table_dealloc},
    {Py_tp_methods, table_methods},
    {0, NULL},
};

static PyType_Spec table_type = {
    .name = "kinespace.library.kernels._compiled.Table",
    .basicsize = sizeof(Table),
    .flags = Py_TPFLAGS_DEFAULT,
    .slots = table_slots,
};

static PyMethodDef bound_methods[] = {
    {"run", FUNCTION(bound_run)},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot bound_slots[] = {
    {Py_tp_new, bound_new},
    {Py_tp_dealloc, bound_dealloc},
    {Py_tp_methods, bound_methods},
    {0, NULL},
};

static PyType_Spec bound_type = {
    .name = "kinespace.library.kernels._compiled.Bound",
    .basicsize = sizeof(Bound),
    .flags = Py_TPFLAGS_DEFAULT,
    .slots = bound_slots,
};

static PyMethodDef methods[] = {
    {"measure_distances", FUNCTION(measure_distances)},
    {"eigenpairs", FUNCTION(eigenpairs)},
    {"follow_phase", FUNCTION(follow_phase)},
    {"moving", FUNCTION(moving)},
    {"steps", FUNCTION(steps)},
    {"extremes", FUNCTION(extremes)},
    {"kind", FUNCTION(kind)},
    {"use", use, METH_O, NULL},
    {NULL, NULL, 0, NULL},
};

static int prepare(PyObject *module) {
    if (choose("avx512") < 0 && choose("avx2") < 0) {
        choose("any");
    }
    PyObject *table = PyType_FromModuleAndSpec(module, &table_type, NULL);
    PyObject *bound = PyType_FromModuleAndSpec(module, &bound_type, NULL);
    int added = table != NULL && PyModule_AddType(module, (PyTypeObject *)table) == 0 && bound != NULL &&
                PyModule_AddType(module, (PyTypeObject *)bound) == 0 &&
                PyModule_AddIntMacro(module, MAX_JOINTS) == 0 && PyModule_AddIntMacro(module, MAX_DIRECTIONS) == 0 &&
                PyModule_AddIntMacro(module, MAX_PARTS) == 0 && PyModule_AddIntMacro(module, MAX_VIEWS) == 0 &&
                PyModule_AddIntMacro(module, MAX_AXES) == 0;
    Py_XDECREF(table);
    Py_XDECREF(bound);
    return added ? 0 : -1;
}

static PyModuleDef_Slot slots[] = {
    {Py_mod_exec, prepare},
    {0, NULL},
};

static PyModuleDef definition = {
    PyModuleDef_HEAD_INIT,
    .m_name = "kinespace.library.kernels._compiled",
    .m_methods = methods,
    .m_slots = slots,
};

PyMODINIT_FUNC PyInit__compiled(void) { return PyModuleDef_Init(&definition); }
