/* The inner loops of a hop, compiled: a few calls instead of numpy's many.
 *
 * Each kernel is the twin of the function of its name in `plain.py`, and computes the same but for rounding; the tests
 * compare the two. The module is optional: without it numpy computes the same, more slowly.
 *
 * Memory is the caller's, in numpy's arrays; none is allocated while a feed runs. `kernels/table.py` checks shapes, types and
 * indices once, when a kernel is bound to its arrays; here only the numbers of a call are checked. The loops in `loops.h` rely
 * on both.
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

/* As in `kernels/__init__.py`. */
#define VERSION 9
/* Frames measured side by side. */
#define TOGETHER 4
/* Sizes for which the stack has room; larger ones are left to numpy. */
#define MAX_JOINTS 256
#define MAX_DIRECTIONS 32
#define MAX_PARTS 8
#define MAX_VIEWS 8
#define MAX_AXES 256
/* Arrays, lengths and numbers of a kernel. */
#define MAX_ARRAYS 16
#define MAX_LENGTHS 8
#define MAX_NUMBERS 8
/* Eigenvectors of a window that are compared with another's. */
#define EIGENVECTORS 4
/* Axes, windows and pairs whose sums are kept in registers. */
#define LANE 64
/* Bytes of a cache line. */
#define LINE 64
/* Points whose products are added up in registers. */
#define SOME_POINTS 16
/* Numbers off a tridiagonal matrix's diagonal that count as 0, when its trace is 1; turns after which all do. */
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
/* A squared distance above all others. */
#define FARTHEST 1e30F

/* A number in half precision, because reading half as much is quicker. */
typedef uint16_t Half;

/* gcc on Windows spills wide registers to where the stack is not aligned for them, and crashes (its bug 54412). */
#if defined(__x86_64__) && (!defined(_WIN32) || defined(__clang__))
#define WIDE_REGISTERS
#endif

#if defined(WIDE_REGISTERS)
#include <immintrin.h>
/* clang ignores a whole target attribute with an option it does not know, and uses 512-bit registers by itself. */
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

/* A kernel: arrays, their lengths, numbers. */
typedef double Kernel(void *const *array, const Py_ssize_t *n, const double *x);
#define KERNELS(X)                                                                                                      \
    X(distances) X(follow) X(follow_products) X(read_parts) X(read_eigen) X(eigenpairs) X(place) X(compare) X(scores)   \
     X(follow_phase) X(moving) X(steps)
#if defined(WIDE_REGISTERS)
#define OF_EACH_KIND(name) {#name, {name##_any, name##_avx2, name##_avx512}},
#else
#define OF_EACH_KIND(name) {#name, {name##_any}},
#endif
static const struct {
    const char *name;
    Kernel *of[3];
} kernels[] = {KERNELS(OF_EACH_KIND)};
static const char *const kinds[] = {"any", "avx2", "avx512"};
#define COUNT(all) (int)(sizeof(all) / sizeof(all)[0])

/* The kind in use. */
static int in_use = 0;

/* Whether the processor has the instructions of a kind of loops; one with AVX2 widens halves, too. */
static int can(const char *kind) {
#if defined(WIDE_REGISTERS)
    __builtin_cpu_init();
    const int avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
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

/* ---- a kernel with its arguments ----------------------------------------------------------------------------------*/

typedef struct {
    int kernel, known, given; /* the numbers given when it is bound, and at each call */
    void *array[MAX_ARRAYS];
    Py_ssize_t length[MAX_LENGTHS];
    double number[MAX_NUMBERS], most[MAX_NUMBERS];
} Bound;

/* run(...): the kernel's numbers of this call; `held` is a Bound in bytes, and the arrays whose memory it uses */
static PyObject *run(PyObject *held, PyObject *const *arguments, Py_ssize_t given) {
    const Bound *bound = (const Bound *)PyBytes_AsString(PyTuple_GetItem(held, 0));
    double number[MAX_NUMBERS];
    if (given != bound->given) {
        return PyErr_Format(PyExc_TypeError, "expected %d numbers, got %zd", bound->given, given);
    }
    memcpy(number, bound->number, sizeof number);
    for (int i = 0; i < bound->given; i++) {
        number[bound->known + i] = PyFloat_AsDouble(arguments[i]);
        if (number[bound->known + i] == -1.0 && PyErr_Occurred()) {
            return NULL;
        }
        if (!(number[bound->known + i] >= 0.0 && number[bound->known + i] <= bound->most[i])) {
            return PyErr_Format(PyExc_ValueError, "number %d: expected 0 to %zd", i, (Py_ssize_t)bound->most[i]);
        }
    }
    return PyFloat_FromDouble(kernels[bound->kernel].of[in_use](bound->array, bound->length, number));
}

static PyMethodDef run_method = {"run", (PyCFunction)(void (*)(void))run, METH_FASTCALL, NULL};

/* bind(name, arrays, lengths, constants, most): `most` is the largest value of each number that is given at each call */
static PyObject *bind(PyObject *module, PyObject *arguments) {
    (void)module;
    const char *name;
    PyObject *arrays, *lengths, *constants, *most;
    if (!PyArg_ParseTuple(arguments, "sO!O!O!O!", &name, &PyTuple_Type, &arrays, &PyTuple_Type, &lengths, &PyTuple_Type,
                          &constants, &PyTuple_Type, &most)) {
        return NULL;
    }
    Bound bound = {.kernel = -1, .known = (int)PyTuple_Size(constants), .given = (int)PyTuple_Size(most)};
    const Py_ssize_t count = PyTuple_Size(arrays), measured = PyTuple_Size(lengths);
    if (count > MAX_ARRAYS || measured > MAX_LENGTHS || bound.known + bound.given > MAX_NUMBERS) {
        return PyErr_Format(PyExc_ValueError, "%s: expected fewer arguments", name);
    }
    for (int k = 0; k < COUNT(kernels); k++) {
        bound.kernel = strcmp(name, kernels[k].name) == 0 ? k : bound.kernel;
    }
    if (bound.kernel < 0) {
        return PyErr_Format(PyExc_ValueError, "name: expected a kernel, got %s", name);
    }
    for (Py_ssize_t i = 0; i < count; i++) {
        Py_buffer buffer;
        if (PyObject_GetBuffer(PyTuple_GetItem(arrays, i), &buffer, PyBUF_STRIDES) < 0) {
            return NULL;
        }
        bound.array[i] = buffer.buf;
        PyBuffer_Release(&buffer);
    }
    for (Py_ssize_t i = 0; i < measured; i++) {
        bound.length[i] = PyLong_AsSsize_t(PyTuple_GetItem(lengths, i));
    }
    for (int i = 0; i < bound.known; i++) {
        bound.number[i] = PyFloat_AsDouble(PyTuple_GetItem(constants, i));
    }
    for (int i = 0; i < bound.given; i++) {
        bound.most[i] = PyFloat_AsDouble(PyTuple_GetItem(most, i));
    }
    PyObject *held = PyErr_Occurred() ? NULL : Py_BuildValue("y#O", (const char *)&bound, (Py_ssize_t)sizeof bound, arrays);
    PyObject *bound_run = held == NULL ? NULL : PyCFunction_New(&run_method, held);
    Py_XDECREF(held);
    return bound_run;
}

/* ---- the module ---------------------------------------------------------------------------------------------------*/

/* kind() -> the kind in use */
static PyObject *kind(PyObject *module, PyObject *nothing) {
    (void)module, (void)nothing;
    return PyUnicode_FromString(kinds[in_use]);
}

/* use(kind): another kind than the best, for tests */
static PyObject *use(PyObject *module, PyObject *name) {
    (void)module;
    const char *text = PyUnicode_AsUTF8AndSize(name, NULL);
    for (int k = 0; text != NULL && k < COUNT(kinds); k++) {
        if (strcmp(text, kinds[k]) == 0 && can(kinds[k])) {
            in_use = k;
            return Py_NewRef(Py_None);
        }
    }
    return text == NULL ? NULL : PyErr_Format(PyExc_ValueError, "kind: expected any, avx2 or avx512, as far as this processor has it, got %s", text);
}

static PyMethodDef methods[] = {
    {"bind", bind, METH_VARARGS, NULL},
    {"kind", kind, METH_NOARGS, NULL},
    {"use", use, METH_O, NULL},
    {NULL, NULL, 0, NULL},
};

static int prepare(PyObject *module) {
    for (int k = 0; k < COUNT(kinds); k++) {
        in_use = can(kinds[k]) ? k : in_use;
    }
    const int failed = PyModule_AddIntMacro(module, VERSION) | PyModule_AddIntMacro(module, MAX_JOINTS) |
                       PyModule_AddIntMacro(module, MAX_DIRECTIONS) | PyModule_AddIntMacro(module, MAX_PARTS) |
                       PyModule_AddIntMacro(module, MAX_VIEWS);
    return failed ? -1 : 0;
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
