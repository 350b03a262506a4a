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
#define VERSION 2
/* Frames measured side by side. */
#define TOGETHER 4
/* Sizes for which the stack has room; larger ones are left to numpy. */
#define MAX_JOINTS 256
#define MAX_DIRECTIONS 32
#define MAX_PARTS 8
#define MAX_VIEWS 8
#define MAX_AXES 256
/* Arrays, lengths and numbers of a kernel. */
#define MAX_ARRAYS 12
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
/* A squared distance above all others. */
#define FARTHEST 1e30F

/* A number in half precision, because reading half as much is quicker. */
typedef uint16_t Half;

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

/* A kernel: arrays, their lengths, numbers. */
typedef double Kernel(void *const *array, const Py_ssize_t *n, const double *x);
#define KERNELS(X)                                                                                                      \
    X(distances) X(follow) X(follow_products) X(read_parts) X(read_eigen) X(eigenpairs) X(place) X(flatten) X(compare)  \
    X(scores) X(follow_phase) X(moving) X(steps) X(extremes)
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

/* ---- a kernel with its arguments ----------------------------------------------------------------------------------*/

typedef struct {
    PyObject_HEAD
    int kernel, arrays, numbers, given; /* the numbers given at each call are the last ones */
    Py_buffer held[MAX_ARRAYS];
    void *array[MAX_ARRAYS];
    Py_ssize_t length[MAX_LENGTHS];
    double number[MAX_NUMBERS], most[MAX_NUMBERS];
} Bound;

static void bound_dealloc(PyObject *self) {
    PyTypeObject *type = Py_TYPE(self);
    for (int i = 0; i < ((Bound *)self)->arrays; i++) {
        PyBuffer_Release(&((Bound *)self)->held[i]);
    }
    ((freefunc)PyType_GetSlot(type, Py_tp_free))(self);
    Py_DECREF(type);
}

static Py_ssize_t size_of(PyObject *tuple, Py_ssize_t most) {
    const Py_ssize_t size = PyTuple_Size(tuple);
    if (size > most) {
        PyErr_Format(PyExc_ValueError, "expected at most %zd arguments, got %zd", most, size);
        return -1;
    }
    return size;
}

/* Bound(name, arrays, lengths, constants, most): `most` is the largest value of each number that is given at each call */
static PyObject *bound_new(PyTypeObject *type, PyObject *arguments, PyObject *named) {
    const char *name;
    PyObject *arrays, *lengths, *constants, *most;
    if (named != NULL || !PyArg_ParseTuple(arguments, "sO!O!O!O!", &name, &PyTuple_Type, &arrays, &PyTuple_Type, &lengths,
                                           &PyTuple_Type, &constants, &PyTuple_Type, &most)) {
        return NULL;
    }
    const Py_ssize_t held = size_of(arrays, MAX_ARRAYS), measured = size_of(lengths, MAX_LENGTHS);
    const Py_ssize_t known = size_of(constants, MAX_NUMBERS), given = known < 0 ? -1 : size_of(most, MAX_NUMBERS - known);
    Bound *bound = held < 0 || measured < 0 || given < 0 ? NULL : (Bound *)((allocfunc)PyType_GetSlot(type, Py_tp_alloc))(type, 0);
    if (bound == NULL) {
        return NULL;
    }
    bound->kernel = -1;
    for (int k = 0; k < COUNT(kernels); k++) {
        bound->kernel = strcmp(name, kernels[k].name) == 0 ? k : bound->kernel;
    }
    if (bound->kernel < 0) {
        PyErr_Format(PyExc_ValueError, "name: expected a kernel, got %s", name);
    }
    for (; bound->arrays < held && !PyErr_Occurred(); bound->arrays++) {
        Py_buffer *buffer = &bound->held[bound->arrays];
        if (PyObject_GetBuffer(PyTuple_GetItem(arrays, bound->arrays), buffer, PyBUF_STRIDES) < 0) {
            break;
        }
        bound->array[bound->arrays] = buffer->buf;
    }
    for (Py_ssize_t i = 0; i < measured && !PyErr_Occurred(); i++) {
        bound->length[i] = PyLong_AsSsize_t(PyTuple_GetItem(lengths, i));
    }
    for (Py_ssize_t i = 0; i < known + given && !PyErr_Occurred(); i++) {
        bound->number[i] = i < known ? PyFloat_AsDouble(PyTuple_GetItem(constants, i)) : 0.0;
        bound->most[i] = i < known ? 0.0 : PyFloat_AsDouble(PyTuple_GetItem(most, i - known));
    }
    bound->numbers = (int)(known + given);
    bound->given = (int)given;
    if (PyErr_Occurred()) {
        Py_CLEAR(bound);
    }
    return (PyObject *)bound;
}

/* run(...): the kernel's numbers of this call */
static PyObject *bound_run(PyObject *self, PyObject *const *arguments, Py_ssize_t given) {
    Bound *bound = (Bound *)self;
    if (given != bound->given) {
        return PyErr_Format(PyExc_TypeError, "expected %d numbers, got %zd", bound->given, given);
    }
    for (int i = 0; i < bound->given; i++) {
        const int place = bound->numbers - bound->given + i;
        const double number = PyFloat_AsDouble(arguments[i]);
        if (number == -1.0 && PyErr_Occurred()) {
            return NULL;
        }
        if (!(number >= 0.0 && number <= bound->most[place])) {
            return PyErr_Format(PyExc_ValueError, "number %d: expected 0 to %zd", i, (Py_ssize_t)bound->most[place]);
        }
        bound->number[place] = number;
    }
    return PyFloat_FromDouble(kernels[bound->kernel].of[in_use](bound->array, bound->length, bound->number));
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

static PyMethodDef bound_methods[] = {
    {"run", (PyCFunction)(void (*)(void))bound_run, METH_FASTCALL, NULL},
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
    {"kind", kind, METH_NOARGS, NULL},
    {"use", use, METH_O, NULL},
    {NULL, NULL, 0, NULL},
};

static int prepare(PyObject *module) {
    for (int k = 0; k < COUNT(kinds); k++) {
        in_use = can(kinds[k]) ? k : in_use;
    }
    PyObject *bound = PyType_FromModuleAndSpec(module, &bound_type, NULL);
    const int added = bound != NULL && PyModule_AddType(module, (PyTypeObject *)bound) == 0 &&
                      PyModule_AddIntMacro(module, VERSION) == 0 && PyModule_AddIntMacro(module, MAX_JOINTS) == 0 && PyModule_AddIntMacro(module, MAX_DIRECTIONS) == 0 &&
                      PyModule_AddIntMacro(module, MAX_PARTS) == 0 && PyModule_AddIntMacro(module, MAX_VIEWS) == 0 &&
                      PyModule_AddIntMacro(module, MAX_AXES) == 0;
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
