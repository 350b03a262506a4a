/* The compiled functions of a hop. Each is the twin of the numpy function of its name, and computes the same but for rounding:
 *
 *   slide       stream/recognizer/window.py
 *   read_distances, read_points   the same
 *
 * The module is optional. Arguments are checked here; a function that gives None leaves the call to numpy.
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

/* Compile a function for some processors, of which the best is chosen when the module is loaded. */
#if defined(__x86_64__) && defined(__GLIBC__) && !defined(__clang__) && __GNUC__ >= 12
#define FOR_EACH_PROCESSOR __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define FOR_EACH_PROCESSOR
#endif
#define INLINE static inline __attribute__((always_inline))

/* Directions of the largest basis, and vectors that are iterated together. */
#define DIRECTIONS 32
#define NEAR 8
/* Products after which the residuals are looked at, products at most, and the residual that is none, when the trace is 1. */
#define TURNS 7
#define MAX_TURNS 21
#define NO_RESIDUAL 1e-9
/* Rounds of rotations at most, and the share of the diagonal that is none. */
#define MAX_ROUNDS 30
#define NONE 1e-15
/* Eigenvectors that must be found. */
#define EIGENVECTORS 4

/* ---- arguments ---------------------------------------------------------------------------------------------------- */

/* Arrays that are read, or written, while a function runs. */
typedef struct {
    Py_buffer views[8];
    int count;
} Arrays;

/* Take arrays, side by side in memory, of so many dimensions each (0: of one or two) and of doubles, but for those whose bit
 * is set: of indices, or written. 0 and an error where one is another. */
static int take(Arrays *arrays, PyObject *const *objects, const int *dimensions, int count, int indices, int written) {
    for (; arrays->count < count; arrays->count++) {
        const int bit = 1 << arrays->count, wanted = dimensions[arrays->count];
        const char *format = indices & bit ? "lqn" : "d", *const of[] = {"1 or 2", "1", "2"};
        Py_buffer *view = &arrays->views[arrays->count];
        if (PyObject_GetBuffer(objects[arrays->count], view, PyBUF_FORMAT | PyBUF_C_CONTIGUOUS | (written & bit ? PyBUF_WRITABLE : 0)) < 0) {
            return 0;
        }
        if ((wanted ? view->ndim != wanted : view->ndim < 1 || view->ndim > 2) || strlen(view->format) != 1 ||
            strchr(format, view->format[0]) == NULL) {
            PyErr_Format(PyExc_ValueError, "expected %s dimensions of %s, got %d of %s", of[wanted], format, view->ndim, view->format);
            PyBuffer_Release(view);
            return 0;
        }
    }
    return 1;
}

/* Let go of all arrays; give a result, or NULL. */
static PyObject *let_go(Arrays *arrays, PyObject *result) {
    for (int i = 0; i < arrays->count; i++) {
        PyBuffer_Release(&arrays->views[i]);
    }
    return result;
}

static PyObject *refused(Arrays *arrays, const char *name) {
    return let_go(arrays, PyErr_Format(PyExc_ValueError, "%s: expected arrays that fit each other", name));
}

/* numpy.empty */
static PyObject *empty;

/* Make a matrix of doubles, or else a vector; NULL and an error where there is no memory. Its memory is `*numbers`. */
static PyObject *new_array(int is_matrix, Py_ssize_t rows, Py_ssize_t columns, double **numbers) {
    PyObject *array = is_matrix ? PyObject_CallFunction(empty, "((nn))", rows, columns) : PyObject_CallFunction(empty, "n", columns);
    Py_buffer view;
    if (array == NULL || PyObject_GetBuffer(array, &view, PyBUF_C_CONTIGUOUS | PyBUF_WRITABLE) < 0) {
        Py_XDECREF(array);
        return NULL;
    }
    *numbers = view.buf;
    PyBuffer_Release(&view);
    return array;
}

/* Eight doubles. */
typedef double Eight __attribute__((vector_size(64), aligned(8), may_alias));
typedef int64_t Bits __attribute__((vector_size(64), aligned(8), may_alias));

/* Natural logarithms of positive numbers x = 2^e m with m near 1: log m = 2 (s + s³/3 + s⁵/5 + ...), s = (m - 1) / (m + 1). */
INLINE Eight logs_of(Eight numbers) {
    union {
        Bits bits;
        Eight whole;
    } each = {.whole = numbers};
    /* m begins at √½, whose bits these are; 52 bits lie behind the point. */
    const Bits exponents = (each.bits - 0x3FE6A09E667F3BCD) >> 52;
    each.bits -= exponents << 52;
    const Eight s = (each.whole - 1) / (each.whole + 1), square = s * s;
    Eight series = square * 0 + 1.0 / 21;
    for (int odd = 19; odd > 0; odd -= 2) {
        series = series * square + 1.0 / odd;
    }
    return 2 * s * series + __builtin_convertvector(exponents, Eight) * 0.693147180559945309417;
}

/* ---- sums that follow a window ------------------------------------------------------------------------------------ */

/* Add one row at a time to the sums, with a weight. */
FOR_EACH_PROCESSOR static void add_row(const double *restrict reference, double *restrict first, double *restrict second,
                                       const double *restrict row, double weight, double time, Py_ssize_t width, int products) {
    double *restrict along = first + width, weighed = weight * time;
    for (Py_ssize_t i = 0; i < width; i++) {
        const double x = row[i] - reference[i];
        first[i] += weight * x;
        along[i] += weighed * x;
    }
    for (Py_ssize_t i = 0; i < width && !products; i++) {
        const double x = row[i] - reference[i];
        second[i] += weight * x * x;
    }
    for (Py_ssize_t i = 0; i < width && products; i++) {
        const double x = weight * (row[i] - reference[i]);
        for (Py_ssize_t j = 0; j < width; j++) {
            second[i * width + j] += x * (row[j] - reference[j]);
        }
    }
}

/* slide(reference, clock, first, second, times, rows, entered, end, left, begin) -> (squares, scatter) */
static PyObject *slide(PyObject *module, PyObject *arguments) {
    (void)module;
    PyObject *object[6];
    Py_ssize_t entered, end, left, begin;
    Arrays arrays = {.count = 0};
    static const int dimensions[] = {1, 1, 2, 0, 1, 2};
    if (!PyArg_ParseTuple(arguments, "OOOOOOnnnn", &object[0], &object[1], &object[2], &object[3], &object[4], &object[5], &entered,
                          &end, &left, &begin)) {
        return NULL;
    }
    if (!take(&arrays, object, dimensions, 6, 0, 1 << 1 | 1 << 2 | 1 << 3)) {
        return let_go(&arrays, NULL);
    }
    const Py_buffer *reference = &arrays.views[0], *clock = &arrays.views[1], *first = &arrays.views[2], *second = &arrays.views[3];
    const Py_buffer *times = &arrays.views[4], *rows = &arrays.views[5];
    const Py_ssize_t width = reference->shape[0], count = rows->shape[0];
    const int products = second->ndim == 2;
    if (clock->shape[0] != 4 || first->shape[0] != 2 || first->shape[1] != width || rows->shape[1] != width ||
        times->shape[0] != count || second->shape[0] != width || second->shape[second->ndim - 1] != width || entered < 0 || end > count || left < 0 || begin > count) {
        return refused(&arrays, "slide");
    }
    double *clocks = clock->buf, *sums = first->buf, *more = second->buf, squares = 0.0, square = 0.0;
    const double *time = times->buf;
    for (int sign = 1; sign >= -1; sign -= 2) {
        const Py_ssize_t from = sign > 0 ? entered : left, to = sign > 0 ? end : begin;
        for (Py_ssize_t row = from; row < to; row++) {
            const double since = time[row] - clocks[0];
            clocks[1] += sign;
            clocks[2] += sign * since;
            clocks[3] += sign * since * since;
            add_row(reference->buf, sums, more, (const double *)rows->buf + row * width, sign, since, width, products);
        }
    }
    for (Py_ssize_t i = 0; i < width; i++) {
        squares += more[products ? i * (width + 1) : i];
        square += sums[i] * sums[i];
    }
    square = squares - square / clocks[1];
    return let_go(&arrays, Py_BuildValue("dd", squares, square));
}

/* ---- parts of a signature ------------------------------------------------------------------------------------------ */

/* Spread, posture and trend of a window, and what its movement is of: the sums of the variances and of the squared means. */
FOR_EACH_PROCESSOR static void read_parts(const double *restrict reference, const double *restrict clock, const double *restrict first,
                                          const double *restrict second, const double *restrict sizing, const Py_ssize_t *restrict segments,
                                          Py_ssize_t between_them, const double *restrict between, Py_ssize_t width, double floor,
                                          double level, double *restrict spread, double *restrict posture, double *restrict trend,
                                          double *restrict moved) {
    const double *restrict along = first + width, per_row = 1.0 / clock[1], middle = clock[2] * per_row;
    const double swing = clock[3] * per_row - middle * middle, per_swing = swing > 0.0 ? 1.0 / sqrt(swing) : 0.0;
    double size = 0.0, total = 0.0, variances = 0.0, squares = 0.0;
    for (Py_ssize_t i = 0; i < width; i++) {
        const double offset = first[i] * per_row, mean = reference[i] + offset, left = second[i] * per_row - offset * offset;
        const double variance = left > 0.0 ? left : 0.0;
        size += mean * sizing[i];
        squares += mean * mean;
        variances += variance;
        spread[i] = sqrt(variance);
        posture[i] = 0.0;
    }
    const double per_size = size > 0.0 ? 1.0 / size : 0.0, noise = floor * size;
    for (Py_ssize_t i = 0; i < width; i++) {
        const double deviation = spread[i] + noise, rising = (along[i] - first[i] * middle) * per_row * per_swing;
        trend[i] = deviation > 0.0 ? rising / deviation : 0.0;
        /* Of nothing and of negative numbers there is no logarithm. */
        spread[i] = spread[i] * per_size + floor < DBL_MIN ? DBL_MIN : spread[i] * per_size + floor;
    }
    for (Py_ssize_t i = 0; i < width; i += 8) {
        Eight some = {0.0};
        const size_t bytes = sizeof(double) * (size_t)(width - i < 8 ? width - i : 8);
        memcpy(&some, spread + i, bytes);
        some = logs_of(some);
        memcpy(spread + i, &some, bytes);
    }
    for (Py_ssize_t i = 0; i < width; i++) {
        total += spread[i];
    }
    for (Py_ssize_t i = 0; i < width; i++) {
        spread[i] -= level * total / (double)width;
    }
    for (Py_ssize_t s = 0; s < between_them; s++) {
        const double length = reference[segments[s]] + first[segments[s]] * per_row;
        for (Py_ssize_t i = 0; i < width; i++) {
            posture[i] += length * between[s * width + i];
        }
    }
    for (Py_ssize_t i = 0; i < width; i++) {
        const double length = between_them ? posture[i] : size;
        posture[i] = length > 0.0 ? (reference[i] + first[i] * per_row) / length : 0.0;
    }
    moved[0] = variances;
    moved[1] = squares;
}

/* read_distances(reference, clock, first, second, body, floor, level) -> (parts, movement) */
static PyObject *read_distances(PyObject *module, PyObject *arguments) {
    (void)module;
    PyObject *object[7];
    double floor, level, *parts, moved[2];
    Arrays arrays = {.count = 0};
    static const int dimensions[] = {1, 1, 2, 1, 1, 1, 2};
    if (!PyArg_ParseTuple(arguments, "OOOOOOOdd", &object[0], &object[1], &object[2], &object[3], &object[4], &object[5], &object[6],
                          &floor, &level)) {
        return NULL;
    }
    if (!take(&arrays, object, dimensions, 7, 1 << 5, 0)) {
        return let_go(&arrays, NULL);
    }
    const Py_buffer *view = arrays.views;
    const Py_ssize_t width = view[0].shape[0], between_them = view[5].shape[0], *segments = view[5].buf;
    int fits = view[1].shape[0] == 4 && view[2].shape[0] == 2 && view[2].shape[1] == width && view[3].shape[0] == width &&
               view[4].shape[0] == width && view[6].shape[0] == between_them && view[6].shape[1] == width;
    for (Py_ssize_t s = 0; s < between_them; s++) {
        fits = fits && segments[s] >= 0 && segments[s] < width;
    }
    if (!fits) {
        return refused(&arrays, "read_distances");
    }
    PyObject *found = new_array(1, 3, width, &parts);
    if (found == NULL) {
        return let_go(&arrays, NULL);
    }
    read_parts(view[0].buf, view[1].buf, view[2].buf, view[3].buf, view[4].buf, segments, between_them, view[6].buf, width, floor, level,
               parts, parts + width, parts + 2 * width, moved);
    return let_go(&arrays, Py_BuildValue("Nd", found, moved[1] > 0.0 ? sqrt(moved[0] / moved[1]) : 0.0));
}

/* ---- eigenpairs of a covariance much like the last one ------------------------------------------------------------ */

typedef double Block[NEAR][DIRECTIONS];

/* Multiply vectors with a symmetric matrix. */
INLINE void multiply(const double (*restrict matrix)[DIRECTIONS], Block vectors, Block products) {
    for (int b = 0; b < NEAR; b++) {
        double sums[DIRECTIONS] = {0.0};
        for (int i = 0; i < DIRECTIONS; i++) {
            for (int j = 0; j < DIRECTIONS; j++) {
                sums[j] += vectors[b][i] * matrix[i][j];
            }
        }
        memcpy(products[b], sums, sizeof sums);
    }
}

INLINE double dot(const double *restrict one, const double *restrict other) {
    double sums[8] = {0.0};
    for (int i = 0; i < DIRECTIONS; i += 8) {
        for (int j = 0; j < 8; j++) {
            sums[j] += one[i + j] * other[i + j];
        }
    }
    return ((sums[0] + sums[1]) + (sums[2] + sums[3])) + ((sums[4] + sums[5]) + (sums[6] + sums[7]));
}

/* Make vectors orthonormal, one after another; 0 where they are dependent. */
INLINE int orthonormal(Block vectors) {
    for (int b = 0; b < NEAR; b++) {
        for (int a = 0; a < b; a++) {
            const double along = dot(vectors[a], vectors[b]);
            for (int i = 0; i < DIRECTIONS; i++) {
                vectors[b][i] -= along * vectors[a][i];
            }
        }
        const double square = dot(vectors[b], vectors[b]);
        if (!(square > DBL_MIN)) {
            return 0;
        }
        const double factor = 1.0 / sqrt(square);
        for (int i = 0; i < DIRECTIONS; i++) {
            vectors[b][i] *= factor;
        }
    }
    return 1;
}

/* Rotate two rows, and two columns, of a small matrix so that the number between them is 0 (Jacobi 1846). */
INLINE void rotate(double a[NEAR][NEAR], double rows[NEAR][NEAR], int p, int q) {
    const double half = (a[q][q] - a[p][p]) / (2 * a[p][q]);
    const double tangent = (half < 0 ? -1.0 : 1.0) / (fabs(half) + sqrt(half * half + 1)), cosine = 1 / sqrt(tangent * tangent + 1);
    const double sine = tangent * cosine;
    for (int k = 0; k < NEAR; k++) {
        const double one = a[k][p], other = a[k][q];
        a[k][p] = cosine * one - sine * other;
        a[k][q] = sine * one + cosine * other;
    }
    for (int k = 0; k < NEAR; k++) {
        const double one = a[p][k], other = a[q][k], row = rows[p][k], next = rows[q][k];
        a[p][k] = cosine * one - sine * other;
        a[q][k] = sine * one + cosine * other;
        rows[p][k] = cosine * row - sine * next;
        rows[q][k] = sine * row + cosine * next;
    }
}

/* Find the eigenvalues of a small symmetric matrix, to its diagonal, and its eigenvectors, to rows, the largest first. */
INLINE void diagonalise(double a[NEAR][NEAR], double rows[NEAR][NEAR]) {
    double largest = 1.0, trace = 0.0;
    for (int i = 0; i < NEAR; i++) {
        for (int j = 0; j < NEAR; j++) {
            rows[i][j] = i == j;
        }
        trace += fabs(a[i][i]);
    }
    for (int round = 0; round < MAX_ROUNDS && largest > NONE * trace; round++) {
        largest = 0.0;
        for (int p = 0; p < NEAR - 1; p++) {
            for (int q = p + 1; q < NEAR; q++) {
                const double apart = fabs(a[p][q]);
                largest = apart > largest ? apart : largest;
                if (apart > NONE * trace) {
                    rotate(a, rows, p, q);
                }
            }
        }
    }
    for (int i = 0; i < NEAR; i++) {
        int place = i;
        for (int j = i + 1; j < NEAR; j++) {
            place = a[j][j] > a[place][place] ? j : place;
        }
        if (place != i) {
            double row[NEAR];
            const double value = a[i][i];
            a[i][i] = a[place][place];
            a[place][place] = value;
            memcpy(row, rows[i], sizeof row);
            memcpy(rows[i], rows[place], sizeof row);
            memcpy(rows[place], row, sizeof row);
        }
    }
}

/* Combine vectors: each row of factors gives one. */
INLINE void combine(double factors[NEAR][NEAR], Block vectors, Block combined) {
    for (int b = 0; b < NEAR; b++) {
        double sums[DIRECTIONS] = {0.0};
        for (int a = 0; a < NEAR; a++) {
            for (int i = 0; i < DIRECTIONS; i++) {
                sums[i] += factors[b][a] * vectors[a][i];
            }
        }
        memcpy(combined[b], sums, sizeof sums);
    }
}

/* Turn vectors to the leading eigenvectors of a matrix: subspace iteration (Rutishauser 1969). 0 where the residuals stay large,
 * or the trace leaves room for another eigenvalue as large as those that are compared. */
FOR_EACH_PROCESSOR static int iterate(const double (*restrict matrix)[DIRECTIONS], double trace, Block vectors,
                                      double *restrict values) {
    Block images, found, turned;
    double inside[NEAR][NEAR], rows[NEAR][NEAR];
    for (int turn = 1; turn <= MAX_TURNS; turn++) {
        if (!orthonormal(vectors)) {
            return 0;
        }
        multiply(matrix, vectors, images);
        if (turn % TURNS == 0) {
            double left = trace, largest = 0.0;
            for (int a = 0; a < NEAR; a++) {
                for (int b = 0; b < NEAR; b++) {
                    inside[a][b] = dot(vectors[a], images[b]);
                }
                left -= inside[a][a];
            }
            diagonalise(inside, rows);
            combine(rows, vectors, found);
            combine(rows, images, turned);
            for (int k = 0; k < NEAR; k++) {
                values[k] = inside[k][k];
                for (int i = 0; i < DIRECTIONS; i++) {
                    turned[k][i] -= values[k] * found[k][i];
                }
                const double square = k < EIGENVECTORS ? dot(turned[k], turned[k]) : 0.0;
                largest = square > largest ? square : largest;
            }
            if (left <= values[EIGENVECTORS - 1] && largest <= NO_RESIDUAL * trace * (NO_RESIDUAL * trace)) {
                memcpy(vectors, found, sizeof found);
                return 1;
            }
        }
        memcpy(vectors, images, sizeof images);
    }
    return 0;
}

/* read_points(clock, first, second, floor, near, eigenvectors) -> (values, vectors, scaled, trace); None where few turns do not find them */
static PyObject *read_points(PyObject *module, PyObject *arguments) {
    (void)module;
    PyObject *object[4];
    Arrays arrays = {.count = 0};
    static const int dimensions[] = {1, 2, 2, 2};
    double floor;
    Py_ssize_t wanted;
    if (!PyArg_ParseTuple(arguments, "OOOdOn", &object[0], &object[1], &object[2], &floor, &object[3], &wanted)) {
        return NULL;
    }
    if (!take(&arrays, object, dimensions, 4, 0, 0)) {
        return let_go(&arrays, NULL);
    }
    const Py_buffer *clock = &arrays.views[0], *first = &arrays.views[1], *second = &arrays.views[2], *near = &arrays.views[3];
    const Py_ssize_t size = second->shape[0];
    if (size > DIRECTIONS || size < 2 * NEAR || near->shape[0] != NEAR || wanted < 1 || wanted > EIGENVECTORS) {
        return let_go(&arrays, Py_NewRef(Py_None));
    }
    if (clock->shape[0] != 4 || first->shape[1] != size || second->shape[1] != size || near->shape[1] != size) {
        return refused(&arrays, "read_points");
    }
    double matrix[DIRECTIONS][DIRECTIONS] = {{0.0}}, values[NEAR], trace = 0.0, total = 0.0, *new_values, *new_vectors, *scaled;
    const double per_row = 1.0 / ((const double *)clock->buf)[1], *sum = first->buf, *products = second->buf;
    Block vectors = {{0.0}};
    for (Py_ssize_t i = 0; i < size; i++) {
        for (Py_ssize_t j = 0; j < size; j++) {
            matrix[i][j] = products[i * size + j] * per_row - sum[i] * per_row * (sum[j] * per_row);
        }
        trace += matrix[i][i];
    }
    for (Py_ssize_t b = 0; b < NEAR; b++) {
        memcpy(vectors[b], (const double *)near->buf + b * size, sizeof(double) * (size_t)size);
    }
    let_go(&arrays, NULL);
    if (!(trace > floor) || !iterate((const double(*)[DIRECTIONS])matrix, trace, vectors, values)) {
        return Py_NewRef(Py_None);
    }
    PyObject *found = new_array(0, 0, NEAR, &new_values), *those = found ? new_array(1, NEAR, size, &new_vectors) : NULL;
    PyObject *parts = those ? new_array(1, wanted, size, &scaled) : NULL;
    if (parts == NULL) {
        Py_XDECREF(found);
        Py_XDECREF(those);
        return NULL;
    }
    memcpy(new_values, values, sizeof values);
    for (Py_ssize_t b = 0; b < NEAR; b++) {
        memcpy(new_vectors + b * size, vectors[b], sizeof(double) * (size_t)size);
        total += b < wanted && values[b] > 0.0 ? values[b] : 0.0;
    }
    for (Py_ssize_t k = 0; k < wanted; k++) {
        const double root = values[k] > 0.0 ? sqrt(sqrt(values[k] / total)) : 0.0;
        for (Py_ssize_t i = 0; i < size; i++) {
            scaled[k * size + i] = root * vectors[k][i];
        }
    }
    return Py_BuildValue("NNNd", found, those, parts, trace);
}

/* ---- the module --------------------------------------------------------------------------------------------------- */

static PyMethodDef methods[] = {
    {"slide", slide, METH_VARARGS, NULL},
    {"read_points", read_points, METH_VARARGS, NULL},
    {"read_distances", read_distances, METH_VARARGS, NULL},
    {NULL, NULL, 0, NULL},
};

static int prepare(PyObject *module) {
    (void)module;
    PyObject *numpy = PyImport_ImportModule("numpy");
    empty = numpy ? PyObject_GetAttrString(numpy, "empty") : NULL;
    Py_XDECREF(numpy);
    return empty ? 0 : -1;
}

static PyModuleDef_Slot slots[] = {
    {Py_mod_exec, prepare},
    {0, NULL},
};

static PyModuleDef definition = {
    PyModuleDef_HEAD_INIT,
    .m_name = "kinespace.library.compiled._loops",
    .m_methods = methods,
    .m_slots = slots,
};

PyMODINIT_FUNC PyInit__loops(void) { return PyModuleDef_Init(&definition); }
