/* The inner loops of a hop, compiled: what numpy does in many calls is done here in a few.
 *
 * Each function is the twin of Python code that is named above it and does the same but for rounding; the tests compare
 * the two with each other and with the slow twins. Nobody needs it: `compiled.py` says whether it was built, and numpy
 * does the same without it, more slowly.
 *
 * Memory is the caller's, in numpy's arrays; none is allocated while a feed runs. Shapes and types are checked here, once
 * a call, and a wrong one raises ValueError; the loops in `loops.h` take for granted that they fit.
 */
#define Py_LIMITED_API 0x030B0000
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <math.h>
#include <stdint.h>
#include <string.h>

#if !defined(__GNUC__)
#error "these loops are written for gcc and clang; without them numpy does the same"
#endif

/* Frames measured side by side. */
#define TOGETHER 4
/* What memory on the stack has room for; what is larger is left to numpy. */
#define MOST_JOINTS 256
#define MOST_DIRECTIONS 32
#define MOST_PARTS 4
#define MOST_AXES 256
#define MOST_OWNED (4 * MOST_PARTS + 4)
/* Bytes of a cache line. */
#define LINE 64
/* Directions, axes and windows whose sums are kept in registers. */
#define BAND 4
#define SOME_AXES 32
#define LANE 64
/* Rows from which the memory is asked for the one that comes so many later. */
#define AHEAD 8
/* Frames centred at a time. */
#define SOME_FRAMES 32

/* Numbers that are worked on together, as wide as the widest registers; where those are narrower, in several. */
typedef double Doubles __attribute__((vector_size(64), aligned(8), may_alias));
typedef float Floats __attribute__((vector_size(64), aligned(4), may_alias));

/* A number in half precision, as library files keep vectors and axes: half as much to read is a third less to wait. */
typedef uint16_t Half;

/* What an object has allocated. */
typedef struct {
    void *blocks[MOST_OWNED];
    int count;
} Memory;

/* How a measure becomes part of a vector: library.metric.Metric. */
typedef struct {
    Py_ssize_t numbers, axes, stride; /* from one number's axes to the next's: a multiple of SOME_AXES */
    float outside, root;              /* the root of its weight */
    float *origin;                    /* (numbers) */
    Half *directions;                 /* (numbers, stride) */
} Part;

/* Measures added up before the logarithm, and the library's windows as they have them. */
typedef struct {
    int begin, end; /* of its parts */
    Py_ssize_t axes;
    Half *windows;  /* b, (lanes, axes, LANE) */
    float *lengths; /* |b|² + nearest, (lanes, LANE) */
} Group;

/* library.windowtable.WindowTable with library.people.People. */
typedef struct {
    PyObject_HEAD
    int parts, groups;
    Part part[MOST_PARTS];
    Group group[MOST_PARTS];
    Py_ssize_t windows, lanes, blocks, classes;
    Py_ssize_t *block_starts, *class_starts; /* one more than there are: where the last one ends */
    float nearest, farthest;
    float *difference; /* (most numbers): what place() works on */
    float *products;   /* (lanes, LANE) */
    Memory memory;
} Table;

/* What a first look knows of axes: library.shortlist.Shortlist. */
typedef struct {
    PyObject_HEAD
    Py_ssize_t motions, lanes, directions, classes;
    Py_ssize_t *class_starts; /* and where the last one ends */
    Half *within;             /* (lanes, directions, LANE) */
    float *outside, *doubt;   /* lengths outside the directions, and of what was rounded off within: (lanes, LANE) */
    Memory memory;
} Look;

/* A live window's vector in one group, and its squared length and what more counts. */
typedef struct {
    float vector[MOST_AXES], square;
} Asking;

/* gcc on Windows spills wide registers to where the stack is not aligned for them, and crashes (its bug 54412). */
#if defined(__x86_64__) && (!defined(_WIN32) || defined(__clang__))
#define WIDE_REGISTERS
#endif

#if defined(WIDE_REGISTERS)
#include <cpuid.h>
#include <immintrin.h>
/* What clang does not know makes it leave out all of a target; unasked it takes registers as wide as the numbers. */
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
    void (*distances)(const double *, Py_ssize_t, Py_ssize_t, const Py_ssize_t *, Py_ssize_t, double *, Py_ssize_t);
    void (*add_rows)(double *, Py_ssize_t, const double *, Py_ssize_t, Py_ssize_t, double);
    double (*spread)(const double *, Py_ssize_t, double, const double *, double, double, double *);
    void (*shape)(const double *, Py_ssize_t, Py_ssize_t, int, double, double, double *);
    void (*turned)(const double *, int, const double *, int, double, double *);
    void (*compare)(const Table *, const double *const *, double *);
    void (*squares)(const Table *, const double *const *, float *);
    void (*products)(const Look *, const float *, float *, Py_ssize_t *);
    Py_ssize_t (*listed)(const Look *, const float *, const float *, float, Py_ssize_t *);
    void (*add_frames)(const double *, Py_ssize_t, Py_ssize_t, Py_ssize_t, Py_ssize_t, const double *, double *, double *,
                       Py_ssize_t, double *, Py_ssize_t);
    void (*times_centred)(const double *, const double *, Py_ssize_t, Py_ssize_t, double *);
    int (*orthonormal)(const double *, Py_ssize_t, Py_ssize_t, double *);
    void (*add_products_of)(const float *, Py_ssize_t, Py_ssize_t, const float *, const Py_ssize_t *, Py_ssize_t, float *);
} loops;

#define CHOOSE(kind)                                                                                                    \
    do {                                                                                                                \
        loops.name = #kind;                                                                                             \
        loops.distances = distances_##kind;                                                                             \
        loops.add_rows = add_rows_##kind;                                                                               \
        loops.spread = spread_##kind;                                                                                   \
        loops.shape = shape_##kind;                                                                                     \
        loops.turned = turned_##kind;                                                                                   \
        loops.compare = compare_##kind;                                                                                 \
        loops.squares = squares_##kind;                                                                                 \
        loops.products = products_##kind;                                                                               \
        loops.listed = listed_##kind;                                                                                   \
        loops.add_frames = add_frames_##kind;                                                                           \
        loops.times_centred = times_centred_##kind;                                                                     \
        loops.orthonormal = orthonormal_##kind;                                                                         \
        loops.add_products_of = add_products_of_##kind;                                                                 \
    } while (0)

#if defined(WIDE_REGISTERS)
/* Whether the processor can widen halves: __builtin_cpu_supports knows the name in recent compilers only. */
static int can_widen(void) {
    unsigned int a, b, c, d;
    return __get_cpuid(1, &a, &b, &c, &d) && (c & bit_F16C) != 0;
}
#endif

/* Whether the processor can do what a kind of loops asks for. */
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

/* Use one kind of loops from now on; -1 if there are none such here. */
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

/* ---- what comes in -----------------------------------------------------------------------------------------------*/

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

/* PyArg_ParseTuple takes what is no tuple for a mistake in this file; it is one of whoever calls. */
static int expect_tuple(const char *name, PyObject *tuple) {
    if (!PyTuple_Check(tuple)) {
        PyErr_Format(PyExc_TypeError, "%s: expected a tuple", name);
        return -1;
    }
    return 0;
}

/* Read a number; the next may be asked for only when this one was there. */
static int take_number(PyObject *object, double *number) {
    *number = PyFloat_AsDouble(object);
    return *number == -1.0 && PyErr_Occurred() ? -1 : 0;
}

static void let_go(Py_buffer *held, int count) {
    for (int i = 0; i < count; i++) {
        PyBuffer_Release(&held[i]); /* of one that is not held nothing happens */
    }
}

/* Hold an array of so many dimensions, of numbers of this type. They lie side by side; between rows there may be room. */
static int hold(Py_buffer *held, PyObject *array, const char *name, int dimensions, const char *type, int writable) {
    if (PyObject_GetBuffer(array, held, PyBUF_STRIDES | PyBUF_FORMAT | (writable ? PyBUF_WRITABLE : 0)) < 0) {
        return -1;
    }
    if (held->ndim != dimensions || held->format == NULL || strcmp(held->format, type) != 0) {
        PyErr_Format(PyExc_ValueError, "%s: expected %d dimensions of type %s, got %d of %s", name, dimensions, type,
                     held->ndim, held->format ? held->format : "B");
        return -1;
    }
    if ((uintptr_t)held->buf % (size_t)held->itemsize != 0) {
        PyErr_Format(PyExc_ValueError, "%s: expected numbers that begin at multiples of their size", name);
        return -1;
    }
    Py_ssize_t apart = held->itemsize;
    for (int i = dimensions - 1; i >= 0; i--) {
        Py_ssize_t stride = held->strides[i];
        int fits = dimensions == 2 && i == 0 ? stride >= apart && stride % held->itemsize == 0 : stride == apart;
        if (held->shape[i] > 1 && !fits) {
            PyErr_Format(PyExc_ValueError, "%s: expected numbers side by side, got some %zd bytes apart", name, stride);
            return -1;
        }
        apart *= held->shape[i];
    }
    return 0;
}

/* Whether some bytes may be in both, those between rows counted. */
static int overlap(const Py_buffer *one, const Py_buffer *other) {
    if (one->len == 0 || other->len == 0) {
        return 0;
    }
    const char *begin = one->buf, *end = begin + (one->shape[0] - 1) * one->strides[0] + one->len / one->shape[0];
    const char *start = other->buf, *stop = start + (other->shape[0] - 1) * other->strides[0] + other->len / other->shape[0];
    return begin < stop && start < end;
}

/* Nothing may be read from where something is written: indices that were checked would be others when they are used. */
static int expect_apart(const char *name, const Py_buffer *written, const Py_buffer *held, int count) {
    for (int i = 0; i < count; i++) {
        if (held + i != written && overlap(held + i, written)) {
            PyErr_Format(PyExc_ValueError, "%s: expected memory that is in no other array", name);
            return -1;
        }
    }
    return 0;
}

static Py_ssize_t stride_of(const Py_buffer *held) { return held->strides[0] / held->itemsize; }

/* ---- distances: library.distances.DistanceMeasurer.measure -------------------------------------------------------*/

static int expect_pairs(const Py_buffer *pairs, Py_ssize_t joints) {
    const Py_ssize_t *ends = pairs->buf;
    if (expect("pairs", 2, pairs->shape[1]) < 0 || (pairs->shape[0] > 1 && expect("pairs", 2, stride_of(pairs)) < 0)) {
        return -1;
    }
    for (Py_ssize_t i = 0; i < 2 * pairs->shape[0]; i++) {
        if (ends[i] < 0 || ends[i] >= joints) {
            PyErr_Format(PyExc_ValueError, "pairs: expected indices of %zd joints, got %zd", joints, ends[i]);
            return -1;
        }
    }
    return 0;
}

/* measure_distances(positions, pairs, rows) */
static PyObject *measure_distances(PyObject *module, PyObject *const *arguments, Py_ssize_t given) {
    (void)module;
    Py_buffer held[3] = {{.obj = NULL}, {.obj = NULL}, {.obj = NULL}}, *positions = held, *pairs = held + 1, *rows = held + 2;
    PyObject *result = NULL;
    if (expect_arguments(3, given) == 0 && hold(positions, arguments[0], "positions", 3, "d", 0) == 0 &&
        hold(pairs, arguments[1], "pairs", 2, INDEX, 0) == 0 && hold(rows, arguments[2], "rows", 2, "d", 1) == 0 &&
        expect_most("joints", MOST_JOINTS, positions->shape[1]) == 0 && expect("axes", 3, positions->shape[2]) == 0 &&
        expect_pairs(pairs, positions->shape[1]) == 0 && expect("rows", positions->shape[0], rows->shape[0]) == 0 &&
        expect("pairs", pairs->shape[0], rows->shape[1]) == 0 && expect_apart("rows", rows, held, 3) == 0) {
        loops.distances(positions->buf, positions->shape[0], positions->shape[1], pairs->buf, pairs->shape[0], rows->buf,
                        stride_of(rows));
        result = Py_NewRef(Py_None);
    }
    let_go(held, 3);
    return result;
}

/* ---- sums: stream.variance.RollingVariance._follow ---------------------------------------------------------------*/

static int expect_sums(const Py_buffer *sums) {
    int fits = expect("sums", 3, sums->shape[0]) == 0 && expect_most("sums", PY_SSIZE_T_MAX, sums->shape[1]) == 0 &&
               expect("sums", sums->shape[1], stride_of(sums)) == 0;
    return fits ? 0 : -1;
}

/* follow(sums, entered, left) -> (the largest sum of squares, the sum that belongs to it) */
static PyObject *follow(PyObject *module, PyObject *const *arguments, Py_ssize_t given) {
    (void)module;
    Py_buffer held[3] = {{.obj = NULL}, {.obj = NULL}, {.obj = NULL}}, *sums = held, *entered = held + 1, *left = held + 2;
    PyObject *result = NULL;
    if (expect_arguments(3, given) == 0 && hold(sums, arguments[0], "sums", 2, "d", 1) == 0 &&
        hold(entered, arguments[1], "entered", 2, "d", 0) == 0 && hold(left, arguments[2], "left", 2, "d", 0) == 0 &&
        expect_sums(sums) == 0 && expect("entered", sums->shape[1], entered->shape[1]) == 0 &&
        expect("left", sums->shape[1], left->shape[1]) == 0 && expect_apart("sums", sums, held, 3) == 0) {
        Py_ssize_t width = sums->shape[1], largest = 0;
        const double *squares = (double *)sums->buf + 2 * width;
        loops.add_rows(sums->buf, width, entered->buf, stride_of(entered), entered->shape[0], 1.0);
        loops.add_rows(sums->buf, width, left->buf, stride_of(left), left->shape[0], -1.0);
        for (Py_ssize_t i = 1; i < width; i++) {
            largest = squares[i] > squares[largest] ? i : largest;
        }
        result = Py_BuildValue("dd", squares[largest], squares[largest - width]);
    }
    let_go(held, 3);
    return result;
}

/* ---- spread: RollingVariance.mean and .deviation, library.measures.Body.spread -----------------------------------*/

/* read_spread(sums, count, sizing, floor, level, numbers) -> movement */
static PyObject *read_spread(PyObject *module, PyObject *const *arguments, Py_ssize_t given) {
    (void)module;
    Py_buffer held[3] = {{.obj = NULL}, {.obj = NULL}, {.obj = NULL}}, *sums = held, *sizing = held + 1, *numbers = held + 2;
    PyObject *result = NULL;
    double count, floor, level;
    if (expect_arguments(6, given) == 0 && hold(sums, arguments[0], "sums", 2, "d", 0) == 0 &&
        hold(sizing, arguments[2], "sizing", 1, "d", 0) == 0 && hold(numbers, arguments[5], "numbers", 1, "d", 1) == 0 &&
        expect_sums(sums) == 0 && expect("sizing", sums->shape[1], sizing->shape[0]) == 0 &&
        expect("numbers", sums->shape[1], numbers->shape[0]) == 0 && expect_apart("numbers", numbers, held, 3) == 0 &&
        take_number(arguments[1], &count) == 0 && take_number(arguments[3], &floor) == 0 &&
        take_number(arguments[4], &level) == 0) {
        result = PyFloat_FromDouble(
            loops.spread(sums->buf, sums->shape[1], count, sizing->buf, floor, level, numbers->buf));
    }
    let_go(held, 3);
    return result;
}

/* ---- shape: library.measures.covariance_in and shape_of ----------------------------------------------------------*/

/* read_shape(courses, floor, no_movement, numbers) */
static PyObject *read_shape(PyObject *module, PyObject *const *arguments, Py_ssize_t given) {
    (void)module;
    Py_buffer held[2] = {{.obj = NULL}, {.obj = NULL}}, *courses = held, *numbers = held + 1;
    PyObject *result = NULL;
    double floor, no_movement;
    if (expect_arguments(4, given) == 0 && hold(courses, arguments[0], "courses", 2, "d", 0) == 0 &&
        hold(numbers, arguments[3], "numbers", 1, "d", 1) == 0 &&
        expect_most("frames", PY_SSIZE_T_MAX, courses->shape[0]) == 0 &&
        expect_most("directions", MOST_DIRECTIONS, courses->shape[1]) == 0 &&
        expect("numbers", courses->shape[1] * (courses->shape[1] + 1) / 2, numbers->shape[0]) == 0 &&
        expect_apart("numbers", numbers, held, 2) == 0 && take_number(arguments[1], &floor) == 0 &&
        take_number(arguments[2], &no_movement) == 0) {
        loops.shape(courses->buf, stride_of(courses), courses->shape[0], (int)courses->shape[1], floor, no_movement,
                    numbers->buf);
        result = Py_NewRef(Py_None);
    }
    let_go(held, 2);
    return result;
}

/* turn_shape(shape, directions, floor, numbers): library.fewerjoints.turned */
static PyObject *turn_shape(PyObject *module, PyObject *const *arguments, Py_ssize_t given) {
    (void)module;
    Py_buffer held[3] = {{.obj = NULL}, {.obj = NULL}, {.obj = NULL}}, *shape = held, *directions = held + 1;
    Py_buffer *numbers = held + 2;
    PyObject *result = NULL;
    double floor;
    if (expect_arguments(4, given) == 0 && hold(shape, arguments[0], "shape", 1, "d", 0) == 0 &&
        hold(directions, arguments[1], "directions", 2, "d", 0) == 0 &&
        hold(numbers, arguments[3], "numbers", 1, "d", 1) == 0 &&
        expect_most("directions", MOST_DIRECTIONS, directions->shape[0]) == 0 &&
        expect_most("directions", MOST_DIRECTIONS, directions->shape[1]) == 0 &&
        expect("directions", directions->shape[1], stride_of(directions)) == 0 &&
        expect("shape", directions->shape[0] * (directions->shape[0] + 1) / 2, shape->shape[0]) == 0 &&
        expect("numbers", directions->shape[1] * (directions->shape[1] + 1) / 2, numbers->shape[0]) == 0 &&
        expect_apart("numbers", numbers, held, 3) == 0 && take_number(arguments[2], &floor) == 0) {
        loops.turned(shape->buf, (int)directions->shape[0], directions->buf, (int)directions->shape[1], floor,
                     numbers->buf);
        result = Py_NewRef(Py_None);
    }
    let_go(held, 3);
    return result;
}

/* ---- the leading axis: stream.gram.RollingGram._follow, CentredGram.times, library.eigen -------------------------*/

/* add_frames(rows, fresh, reference, relative, square, of_each): the last `fresh` of the rows are new in the square */
static PyObject *add_frames(PyObject *module, PyObject *const *arguments, Py_ssize_t given) {
    (void)module;
    Py_buffer held[5] = {{.obj = NULL}, {.obj = NULL}, {.obj = NULL}, {.obj = NULL}, {.obj = NULL}};
    Py_buffer *rows = held, *reference = held + 1, *relative = held + 2, *square = held + 3, *of_each = held + 4;
    PyObject *result = NULL;
    if (expect_arguments(6, given) == 0 && hold(rows, arguments[0], "rows", 2, "d", 0) == 0 &&
        hold(reference, arguments[2], "reference", 1, "d", 0) == 0 &&
        hold(relative, arguments[3], "relative", 2, "d", 1) == 0 && hold(square, arguments[4], "square", 2, "d", 1) == 0 &&
        hold(of_each, arguments[5], "of_each", 2, "d", 1) == 0 &&
        expect("reference", rows->shape[1], reference->shape[0]) == 0 &&
        expect("relative", TOGETHER, relative->shape[0]) == 0 && expect("relative", rows->shape[1], relative->shape[1]) == 0 &&
        expect("relative", rows->shape[1], stride_of(relative)) == 0 &&
        expect("square", rows->shape[0], square->shape[0]) == 0 && expect("square", rows->shape[0], square->shape[1]) == 0 &&
        expect("of_each", 2, of_each->shape[0]) == 0 && expect("of_each", rows->shape[0], of_each->shape[1]) == 0 &&
        expect_apart("relative", relative, held, 5) == 0 && expect_apart("square", square, held, 5) == 0 &&
        expect_apart("of_each", of_each, held, 5) == 0) {
        Py_ssize_t fresh = PyLong_AsSsize_t(arguments[1]);
        if (!(fresh == -1 && PyErr_Occurred()) && expect_most("fresh", rows->shape[0], fresh) == 0) {
            loops.add_frames(rows->buf, stride_of(rows), rows->shape[0], rows->shape[1], fresh, reference->buf, relative->buf,
                             square->buf, stride_of(square), of_each->buf, stride_of(of_each));
            result = Py_NewRef(Py_None);
        }
    }
    let_go(held, 5);
    return result;
}

/* times_centred(vectors, square, images) */
static PyObject *times_centred(PyObject *module, PyObject *const *arguments, Py_ssize_t given) {
    (void)module;
    Py_buffer held[3] = {{.obj = NULL}, {.obj = NULL}, {.obj = NULL}}, *vectors = held, *square = held + 1, *images = held + 2;
    PyObject *result = NULL;
    if (expect_arguments(3, given) == 0 && hold(vectors, arguments[0], "vectors", 2, "d", 0) == 0 &&
        hold(square, arguments[1], "square", 2, "d", 0) == 0 && hold(images, arguments[2], "images", 2, "d", 1) == 0 &&
        expect("vectors", TOGETHER, vectors->shape[0]) == 0 && expect("images", TOGETHER, images->shape[0]) == 0 &&
        expect("square", square->shape[0], square->shape[1]) == 0 &&
        expect("vectors", square->shape[0], vectors->shape[1]) == 0 &&
        expect("images", square->shape[0], images->shape[1]) == 0 &&
        expect("vectors", vectors->shape[1], stride_of(vectors)) == 0 &&
        expect("images", images->shape[1], stride_of(images)) == 0 && expect_apart("images", images, held, 3) == 0) {
        loops.times_centred(vectors->buf, square->buf, stride_of(square), square->shape[0], images->buf);
        result = Py_NewRef(Py_None);
    }
    let_go(held, 3);
    return result;
}

/* orthonormal(vectors, basis) -> whether there is one */
static PyObject *orthonormal(PyObject *module, PyObject *const *arguments, Py_ssize_t given) {
    (void)module;
    Py_buffer held[2] = {{.obj = NULL}, {.obj = NULL}}, *vectors = held, *basis = held + 1;
    PyObject *result = NULL;
    if (expect_arguments(2, given) == 0 && hold(vectors, arguments[0], "vectors", 2, "d", 0) == 0 &&
        hold(basis, arguments[1], "basis", 2, "d", 1) == 0 && expect("basis", vectors->shape[0], basis->shape[0]) == 0 &&
        expect("basis", vectors->shape[1], basis->shape[1]) == 0 &&
        expect("vectors", vectors->shape[1], stride_of(vectors)) == 0 &&
        expect("basis", basis->shape[1], stride_of(basis)) == 0 && expect_apart("basis", basis, held, 2) == 0) {
        result = PyBool_FromLong(loops.orthonormal(vectors->buf, vectors->shape[0], vectors->shape[1], basis->buf));
    }
    let_go(held, 2);
    return result;
}

/* ---- windows compared: library.windowtable.WindowTable.compared --------------------------------------------------*/

/* Give zeros that begin with a cache line; NULL and an error when there are none to be had. */
static void *zeros(Memory *memory, Py_ssize_t count, size_t bytes) {
    void *block = memory->count < MOST_OWNED ? PyMem_Calloc((size_t)count + LINE, bytes) : NULL;
    if (block == NULL) {
        return PyErr_NoMemory();
    }
    memory->blocks[memory->count++] = block;
    return (char *)block + (LINE - (uintptr_t)block % LINE) % LINE;
}

/* Free an object, and its memory. */
static void give_back(PyObject *self, Memory *memory) {
    PyTypeObject *type = Py_TYPE(self);
    while (memory->count > 0) {
        PyMem_Free(memory->blocks[--memory->count]);
    }
    ((freefunc)PyType_GetSlot(type, Py_tp_free))(self);
    Py_DECREF(type);
}

/* Take over where things start, ascending from 0, and set where the last of them ends. */
static Py_ssize_t *take_starts(Memory *memory, PyObject *starts, const char *name, Py_ssize_t end, Py_ssize_t *count) {
    Py_buffer held = {.obj = NULL};
    Py_ssize_t *taken = NULL;
    if (hold(&held, starts, name, 1, INDEX, 0) == 0 && expect_most(name, end, held.shape[0]) == 0 &&
        (taken = zeros(memory, held.shape[0] + 1, sizeof(Py_ssize_t))) != NULL) {
        *count = held.shape[0];
        memcpy(taken, held.buf, sizeof(Py_ssize_t) * (size_t)*count);
        taken[*count] = end;
        int ascending = taken[0] == 0;
        for (Py_ssize_t i = 0; i < *count; i++) {
            ascending = ascending && taken[i] < taken[i + 1];
        }
        if (!ascending) {
            PyErr_Format(PyExc_ValueError, "%s: expected to start at 0 and ascend below %zd", name, end);
            taken = NULL;
        }
    }
    let_go(&held, 1);
    return taken;
}

/* Lay halves (rows, columns) out, lane by lane of rows. */
static Half *take_lanes(Memory *memory, const Py_buffer *halves) {
    Py_ssize_t columns = halves->shape[1], lanes = (halves->shape[0] + LANE - 1) / LANE;
    Half *taken = zeros(memory, lanes * columns * LANE, sizeof(Half));
    for (Py_ssize_t row = 0; taken != NULL && row < halves->shape[0]; row++) {
        const Half *numbers = (Half *)halves->buf + row * stride_of(halves);
        for (Py_ssize_t k = 0; k < columns; k++) {
            taken[(row / LANE * columns + k) * LANE + row % LANE] = numbers[k];
        }
    }
    return taken;
}

/* Take over (origin, axes, outside, weight). */
static int take_part(Table *table, Part *part, PyObject *tuple) {
    Py_buffer held[2] = {{.obj = NULL}, {.obj = NULL}}, *origin = held, *axes = held + 1;
    PyObject *origins, *directions;
    float weight;
    int result = -1;
    if (expect_tuple("part", tuple) == 0 && PyArg_ParseTuple(tuple, "OOff", &origins, &directions, &part->outside, &weight) &&
        hold(origin, origins, "origin", 1, "f", 0) == 0 && hold(axes, directions, "axes", 2, "e", 0) == 0 &&
        expect("axes", origin->shape[0], axes->shape[0]) == 0 && expect_most("axes", MOST_AXES, axes->shape[1]) == 0) {
        part->numbers = axes->shape[0];
        part->axes = axes->shape[1];
        part->stride = (part->axes + SOME_AXES - 1) / SOME_AXES * SOME_AXES;
        part->root = sqrtf(weight);
        if ((part->origin = zeros(&table->memory, part->numbers, sizeof(float))) != NULL &&
            (part->directions = zeros(&table->memory, part->numbers * part->stride, sizeof(Half))) != NULL) {
            memcpy(part->origin, origin->buf, sizeof(float) * (size_t)part->numbers);
            for (Py_ssize_t i = 0; i < part->numbers; i++) {
                memcpy(part->directions + i * part->stride, (Half *)axes->buf + i * stride_of(axes),
                       sizeof(Half) * (size_t)part->axes);
            }
            result = 0;
        }
    }
    let_go(held, 2);
    return result;
}

/* Lay out a group's windows and their squared lengths. */
static int take_windows(Table *table, Group *group, PyObject *vectors, PyObject *squares) {
    Py_buffer held[2] = {{.obj = NULL}, {.obj = NULL}}, *halves = held, *lengths = held + 1;
    int result = -1;
    if (hold(halves, vectors, "vectors", 2, "e", 0) == 0 && hold(lengths, squares, "lengths", 1, "f", 0) == 0 &&
        expect("vectors", table->windows, halves->shape[0]) == 0 && expect("axes", group->axes, halves->shape[1]) == 0 &&
        expect("lengths", table->windows, lengths->shape[0]) == 0 && expect_most("axes", MOST_AXES, group->axes) == 0 &&
        (group->windows = take_lanes(&table->memory, halves)) != NULL &&
        (group->lengths = zeros(&table->memory, table->lanes * LANE, sizeof(float))) != NULL) {
        for (Py_ssize_t w = 0; w < table->windows; w++) {
            group->lengths[w] = ((float *)lengths->buf)[w] + table->nearest;
        }
        result = 0;
    }
    let_go(held, 2);
    return result;
}

/* Take over a group: ((part, ...), vectors, their squared lengths). */
static int take_group(Table *table, PyObject *tuple) {
    PyObject *parts, *vectors, *squares;
    if (expect_tuple("group", tuple) < 0 || !PyArg_ParseTuple(tuple, "O!OO", &PyTuple_Type, &parts, &vectors, &squares)) {
        return -1;
    }
    Group *group = &table->group[table->groups++];
    group->begin = group->end = table->parts;
    for (Py_ssize_t p = 0; p < PyTuple_Size(parts); p++) {
        if (expect_most("parts", MOST_PARTS, table->parts + 1) < 0) {
            return -1;
        }
        Part *part = &table->part[table->parts++];
        if (take_part(table, part, PyTuple_GetItem(parts, p)) < 0) {
            return -1;
        }
        group->end = table->parts;
        group->axes += part->axes;
    }
    return take_windows(table, group, vectors, squares);
}

static int take_groups(Table *table, PyObject *groups) {
    Py_ssize_t count = PyTuple_Size(groups), most = 0;
    if (expect_most("groups", MOST_PARTS, count) < 0) {
        return -1;
    }
    for (Py_ssize_t g = 0; g < count; g++) {
        if (take_group(table, PyTuple_GetItem(groups, g)) < 0) {
            return -1;
        }
    }
    for (int p = 0; p < table->parts; p++) {
        most = table->part[p].numbers > most ? table->part[p].numbers : most;
    }
    table->difference = zeros(&table->memory, most, sizeof(float));
    return table->difference ? 0 : -1;
}

static void table_dealloc(PyObject *self) { give_back(self, &((Table *)self)->memory); }

/* Table(groups, windows, block starts, class starts, nearest, farthest) */
static PyObject *table_new(PyTypeObject *type, PyObject *arguments, PyObject *named) {
    PyObject *groups, *blocks, *classes;
    Py_ssize_t windows;
    float nearest, farthest;
    if ((named != NULL && expect_arguments(0, PyDict_Size(named)) < 0) ||
        !PyArg_ParseTuple(arguments, "O!nOOff", &PyTuple_Type, &groups, &windows, &blocks, &classes, &nearest, &farthest) ||
        expect_most("windows", PY_SSIZE_T_MAX / (Py_ssize_t)sizeof(float) / LANE / MOST_AXES / 2, windows) < 0) {
        return NULL;
    }
    Table *table = (Table *)((allocfunc)PyType_GetSlot(type, Py_tp_alloc))(type, 0);
    if (table == NULL) {
        return NULL;
    }
    table->windows = windows;
    table->lanes = (windows + LANE - 1) / LANE;
    table->nearest = nearest;
    table->farthest = farthest;
    if ((table->products = zeros(&table->memory, table->lanes * LANE, sizeof(float))) == NULL ||
        (table->block_starts = take_starts(&table->memory, blocks, "blocks", windows, &table->blocks)) == NULL ||
        (table->class_starts = take_starts(&table->memory, classes, "classes", table->blocks, &table->classes)) == NULL ||
        take_groups(table, groups) < 0) {
        Py_DECREF(table);
        return NULL;
    }
    return (PyObject *)table;
}

/* Hold a measure for each part, (numbers). */
static int hold_measures(const Table *table, Py_buffer *held, const double **measures, PyObject *const *arguments) {
    for (int p = 0; p < table->parts; p++) {
        if (hold(&held[p], arguments[p], "measure", 1, "d", 0) < 0 ||
            expect("measure", table->part[p].numbers, held[p].shape[0]) < 0) {
            return -1;
        }
        measures[p] = held[p].buf;
    }
    return 0;
}

/* compared(measure, ..., logs): a measure for each part, (numbers); logs (classes) */
static PyObject *table_compared(PyObject *self, PyObject *const *arguments, Py_ssize_t given) {
    Table *table = (Table *)self;
    Py_buffer held[MOST_PARTS + 1] = {{.obj = NULL}}, *logs = held + table->parts;
    const double *measures[MOST_PARTS];
    PyObject *result = NULL;
    if (expect_arguments(table->parts + 1, given) == 0 && hold_measures(table, held, measures, arguments) == 0 &&
        hold(logs, arguments[table->parts], "logs", 1, "d", 1) == 0 &&
        expect("logs", table->classes, logs->shape[0]) == 0 && expect_apart("logs", logs, held, MOST_PARTS + 1) == 0) {
        loops.compare(table, measures, logs->buf);
        result = Py_NewRef(Py_None);
    }
    let_go(held, MOST_PARTS + 1);
    return result;
}

/* squares(measure, ..., squares): the same; squares (groups, windows) */
static PyObject *table_squares(PyObject *self, PyObject *const *arguments, Py_ssize_t given) {
    Table *table = (Table *)self;
    Py_buffer held[MOST_PARTS + 1] = {{.obj = NULL}}, *squares = held + table->parts;
    const double *measures[MOST_PARTS];
    PyObject *result = NULL;
    if (expect_arguments(table->parts + 1, given) == 0 && hold_measures(table, held, measures, arguments) == 0 &&
        hold(squares, arguments[table->parts], "squares", 2, "f", 1) == 0 &&
        expect("squares", table->groups, squares->shape[0]) == 0 &&
        expect("squares", table->windows, squares->shape[1]) == 0 &&
        (table->groups == 1 || expect("squares", table->windows, stride_of(squares)) == 0) &&
        expect_apart("squares", squares, held, MOST_PARTS + 1) == 0) {
        loops.squares(table, measures, squares->buf);
        result = Py_NewRef(Py_None);
    }
    let_go(held, MOST_PARTS + 1);
    return result;
}

/* ---- a short list: library.shortlist.Shortlist --------------------------------------------------------------------*/

static void look_dealloc(PyObject *self) { give_back(self, &((Look *)self)->memory); }

static int take_axes(Look *look, const Py_buffer *within, const Py_buffer *outside, const Py_buffer *doubt) {
    if ((look->within = take_lanes(&look->memory, within)) == NULL ||
        (look->outside = zeros(&look->memory, look->lanes * LANE, sizeof(float))) == NULL ||
        (look->doubt = zeros(&look->memory, look->lanes * LANE, sizeof(float))) == NULL) {
        return -1;
    }
    memcpy(look->outside, outside->buf, sizeof(float) * (size_t)look->motions);
    memcpy(look->doubt, doubt->buf, sizeof(float) * (size_t)look->motions);
    return 0;
}

/* Look(within, outside, doubt, class starts) */
static PyObject *look_new(PyTypeObject *type, PyObject *arguments, PyObject *named) {
    Py_buffer held[3] = {{.obj = NULL}, {.obj = NULL}, {.obj = NULL}}, *within = held, *outside = held + 1, *doubt = held + 2;
    PyObject *halves, *lengths, *doubts, *classes, *result = NULL;
    if ((named == NULL || expect_arguments(0, PyDict_Size(named)) == 0) &&
        PyArg_ParseTuple(arguments, "OOOO", &halves, &lengths, &doubts, &classes) &&
        hold(within, halves, "within", 2, "e", 0) == 0 && hold(outside, lengths, "outside", 1, "f", 0) == 0 &&
        hold(doubt, doubts, "doubt", 1, "f", 0) == 0 &&
        expect_most("motions", PY_SSIZE_T_MAX / LINE / MOST_AXES, within->shape[0]) == 0 &&
        expect_most("directions", MOST_AXES, within->shape[1]) == 0 &&
        expect("outside", within->shape[0], outside->shape[0]) == 0 &&
        expect("doubt", within->shape[0], doubt->shape[0]) == 0) {
        Look *look = (Look *)((allocfunc)PyType_GetSlot(type, Py_tp_alloc))(type, 0);
        if (look != NULL) {
            result = (PyObject *)look;
            look->motions = within->shape[0];
            look->directions = within->shape[1];
            look->lanes = (look->motions + LANE - 1) / LANE;
            look->class_starts = take_starts(&look->memory, classes, "classes", look->motions, &look->classes);
            if (look->class_starts == NULL || take_axes(look, within, outside, doubt) < 0) {
                Py_CLEAR(result);
            }
        }
    }
    let_go(held, 3);
    return result;
}

/* products(axis, products, best): of an axis (directions) with all motions' (motions), and each class's best (classes) */
static PyObject *look_products(PyObject *self, PyObject *const *arguments, Py_ssize_t given) {
    const Look *look = (Look *)self;
    Py_buffer held[3] = {{.obj = NULL}, {.obj = NULL}, {.obj = NULL}}, *axis = held, *products = held + 1, *best = held + 2;
    PyObject *result = NULL;
    if (expect_arguments(3, given) == 0 && hold(axis, arguments[0], "axis", 1, "f", 0) == 0 &&
        hold(products, arguments[1], "products", 1, "f", 1) == 0 && hold(best, arguments[2], "best", 1, INDEX, 1) == 0 &&
        expect("axis", look->directions, axis->shape[0]) == 0 && expect("products", look->motions, products->shape[0]) == 0 &&
        expect("best", look->classes, best->shape[0]) == 0 && expect_apart("products", products, held, 3) == 0 &&
        expect_apart("best", best, held, 3) == 0) {
        loops.products(look, axis->buf, products->buf, best->buf);
        result = Py_NewRef(Py_None);
    }
    let_go(held, 3);
    return result;
}

/* listed(products, least, outside, listed) -> how many motions may score what is the least of their class, or more */
static PyObject *look_listed(PyObject *self, PyObject *const *arguments, Py_ssize_t given) {
    const Look *look = (Look *)self;
    Py_buffer held[3] = {{.obj = NULL}, {.obj = NULL}, {.obj = NULL}}, *products = held, *least = held + 1, *listed = held + 2;
    PyObject *result = NULL;
    double outside;
    if (expect_arguments(4, given) == 0 && hold(products, arguments[0], "products", 1, "f", 0) == 0 &&
        hold(least, arguments[1], "least", 1, "f", 0) == 0 && hold(listed, arguments[3], "listed", 1, INDEX, 1) == 0 &&
        expect("products", look->motions, products->shape[0]) == 0 && expect("least", look->classes, least->shape[0]) == 0 &&
        expect("listed", look->motions, listed->shape[0]) == 0 && expect_apart("listed", listed, held, 3) == 0 &&
        take_number(arguments[2], &outside) == 0) {
        result = PyLong_FromSsize_t(loops.listed(look, products->buf, least->buf, (float)outside, listed->buf));
    }
    let_go(held, 3);
    return result;
}

/* add_products(rows, vector, listed, sums) */
static PyObject *add_products(PyObject *module, PyObject *const *arguments, Py_ssize_t given) {
    (void)module;
    Py_buffer held[4] = {{.obj = NULL}, {.obj = NULL}, {.obj = NULL}, {.obj = NULL}};
    Py_buffer *rows = held, *vector = held + 1, *listed = held + 2, *sums = held + 3;
    PyObject *result = NULL;
    if (expect_arguments(4, given) == 0 && hold(rows, arguments[0], "rows", 2, "f", 0) == 0 &&
        hold(vector, arguments[1], "vector", 1, "f", 0) == 0 && hold(listed, arguments[2], "listed", 1, INDEX, 0) == 0 &&
        hold(sums, arguments[3], "sums", 1, "f", 1) == 0 && expect("vector", rows->shape[1], vector->shape[0]) == 0 &&
        expect("sums", listed->shape[0], sums->shape[0]) == 0 && expect_apart("sums", sums, held, 4) == 0) {
        const Py_ssize_t *places = listed->buf;
        int fits = 1;
        for (Py_ssize_t i = 0; i < listed->shape[0]; i++) {
            fits = fits && places[i] >= 0 && places[i] < rows->shape[0];
        }
        if (fits) {
            loops.add_products_of(rows->buf, stride_of(rows), rows->shape[1], vector->buf, places, listed->shape[0],
                                  sums->buf);
            result = Py_NewRef(Py_None);
        } else {
            PyErr_Format(PyExc_ValueError, "listed: expected indices of %zd rows", rows->shape[0]);
        }
    }
    let_go(held, 4);
    return result;
}

/* ---- which loops -------------------------------------------------------------------------------------------------*/

/* kind() -> those in use */
static PyObject *kind(PyObject *module, PyObject *const *arguments, Py_ssize_t given) {
    (void)module, (void)arguments;
    return expect_arguments(0, given) == 0 ? PyUnicode_FromString(loops.name) : NULL;
}

/* use(kind): others than the best, so that those can be tested */
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
    {"compared", FUNCTION(table_compared)},
    {"squares", FUNCTION(table_squares)},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot table_slots[] = {
    {Py_tp_new, table_new},
    {Py_tp_dealloc, table_dealloc},
    {Py_tp_methods, table_methods},
    {0, NULL},
};

static PyType_Spec table_type = {
    .name = "library._compiled.Table",
    .basicsize = sizeof(Table),
    .flags = Py_TPFLAGS_DEFAULT,
    .slots = table_slots,
};

static PyMethodDef look_methods[] = {
    {"products", FUNCTION(look_products)},
    {"listed", FUNCTION(look_listed)},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot look_slots[] = {
    {Py_tp_new, look_new},
    {Py_tp_dealloc, look_dealloc},
    {Py_tp_methods, look_methods},
    {0, NULL},
};

static PyType_Spec look_type = {
    .name = "library._compiled.Look",
    .basicsize = sizeof(Look),
    .flags = Py_TPFLAGS_DEFAULT,
    .slots = look_slots,
};

static PyMethodDef methods[] = {
    {"measure_distances", FUNCTION(measure_distances)},
    {"follow", FUNCTION(follow)},
    {"read_spread", FUNCTION(read_spread)},
    {"read_shape", FUNCTION(read_shape)},
    {"turn_shape", FUNCTION(turn_shape)},
    {"add_products", FUNCTION(add_products)},
    {"add_frames", FUNCTION(add_frames)},
    {"times_centred", FUNCTION(times_centred)},
    {"orthonormal", FUNCTION(orthonormal)},
    {"kind", FUNCTION(kind)},
    {"use", use, METH_O, NULL},
    {NULL, NULL, 0, NULL},
};

static int add_type(PyObject *module, PyType_Spec *spec) {
    PyObject *type = PyType_FromModuleAndSpec(module, spec, NULL);
    int result = type == NULL ? -1 : PyModule_AddType(module, (PyTypeObject *)type);
    Py_XDECREF(type);
    return result;
}

static int prepare(PyObject *module) {
    if (choose("avx512") < 0 && choose("avx2") < 0) {
        choose("any");
    }
    int added = add_type(module, &table_type) == 0 && add_type(module, &look_type) == 0 &&
                PyModule_AddIntMacro(module, MOST_JOINTS) == 0 && PyModule_AddIntMacro(module, MOST_DIRECTIONS) == 0 &&
                PyModule_AddIntMacro(module, MOST_AXES) == 0 && PyModule_AddIntMacro(module, TOGETHER) == 0;
    return added ? 0 : -1;
}

static PyModuleDef_Slot slots[] = {
    {Py_mod_exec, prepare},
    {0, NULL},
};

static PyModuleDef definition = {
    PyModuleDef_HEAD_INIT,
    .m_name = "library._compiled",
    .m_methods = methods,
    .m_slots = slots,
};

PyMODINIT_FUNC PyInit__compiled(void) { return PyModuleDef_Init(&definition); }
