/* The loops behind `compiled.c`, written once and compiled for each kind of processor.
 *
 * The file that includes this one defines KIND(name), the name under which a function is compiled; LOOP, the attributes of
 * every function, namely the processor it is for; and REGISTER, the bytes of the registers in which halves turn into
 * floats, 0 for none.
 *
 * A kernel gets its arrays, their lengths n and its numbers x in the order of `kernels/table.py`, where they are checked;
 * the comment before each kernel lists them.
 */

#define HELPER LOOP static inline __attribute__((always_inline))
#define KERNEL(name)                                                                                                    \
    LOOP static double KIND(name)(void *const *restrict array, const Py_ssize_t *restrict n, const double *restrict x)

/* The bytes and floats of a register, and the sums of four products each that fit into registers at once. */
#if REGISTER == 0
#define BYTES 16
#else
#define BYTES REGISTER
#endif
#define FLOATS (BYTES / 4)
#define REGISTERS (REGISTER == 64 ? 4 : 2)
/* The registers that the directions of a vector fill. */
#define WIDE (MAX_DIRECTIONS * 8 / BYTES)
#define BLOCK_WIDE (BLOCK * 8 / BYTES)
#define ROWS (REGISTER == 64 ? 8 : 4)
typedef double KIND(Doubles) __attribute__((vector_size(BYTES), aligned(8), may_alias));
typedef int64_t KIND(Longs) __attribute__((vector_size(BYTES), aligned(8), may_alias));
typedef float KIND(Floats) __attribute__((vector_size(BYTES), aligned(4), may_alias));
typedef int32_t KIND(Ints) __attribute__((vector_size(BYTES), aligned(4), may_alias));

/* Make floats of as many halves. */
HELPER KIND(Floats) KIND(widen)(const Half *restrict halves) {
#if REGISTER == 64
    return (KIND(Floats))_mm512_cvtph_ps(_mm256_loadu_si256((const __m256i *)halves));
#elif REGISTER == 32
    return (KIND(Floats))_mm256_cvtph_ps(_mm_loadu_si128((const __m128i *)halves));
#else
    /* Sign, exponent and digits go to where a float has them; what the exponents are apart is made up for. */
    union {
        uint32_t bits[FLOATS];
        KIND(Floats) whole;
    } all;
    for (int i = 0; i < FLOATS; i++) {
        all.bits[i] = (uint32_t)(halves[i] & 0x7FFF) << 13 | (uint32_t)(halves[i] & 0x8000) << 16;
    }
    return all.whole * 0x1p112F;
#endif
}

/* Natural logarithms of positive numbers x = 2^e m with m near 1: log m = 2 (s + s³/3 + s⁵/5 + ...), s = (m - 1) / (m + 1).
 * `half` is the bits of √½, where m begins; `digits` those after the point; `last` the last odd number of the series. */
#define LOGARITHMS(name, Numbers, Bits, Number, half, digits, last)                                                     \
    HELPER Numbers KIND(name)(Numbers numbers) {                                                                        \
        union {                                                                                                         \
            Bits bits;                                                                                                  \
            Numbers whole;                                                                                              \
        } each = {.whole = numbers};                                                                                    \
        const Bits exponents = (each.bits - half) >> digits;                                                            \
        each.bits -= exponents << digits;                                                                               \
        const Numbers s = (each.whole - 1) / (each.whole + 1), square = s * s;                                          \
        Numbers series = square * 0 + (Number)1 / last;                                                                 \
        for (int odd = last - 2; odd > 0; odd -= 2) {                                                                   \
            series = series * square + (Number)1 / (Number)odd;                                                         \
        }                                                                                                               \
        return 2 * s * series + __builtin_convertvector(exponents, Numbers) * (Number)0.693147180559945309417;          \
    }
LOGARITHMS(logs, KIND(Doubles), KIND(Longs), double, 0x3FE6A09E667F3BCD, 52, 21)
LOGARITHMS(float_logs, KIND(Floats), KIND(Ints), float, 0x3F3504F3, 23, 9)

/* Distances of the first frames between pairs of joints. positions (frames, joints, 3), pairs (pairs, 2), rows (frames,
 * pairs); n: frames, joints, pairs, from one row to the next; x: frames. */
KERNEL(distances) {
    const double *restrict positions = array[0];
    const Py_ssize_t *restrict pairs = array[1];
    double *restrict rows = array[2];
    const Py_ssize_t frames = (Py_ssize_t)x[0], joints = n[1], count = n[2], stride = n[3];
    double places[MAX_JOINTS][3][TOGETHER];
    for (Py_ssize_t begin = 0; begin < frames; begin += TOGETHER) {
        Py_ssize_t some = frames - begin < TOGETHER ? frames - begin : TOGETHER;
        for (Py_ssize_t j = 0; j < joints; j++) {
            for (int axis = 0; axis < 3; axis++) {
                for (Py_ssize_t k = 0; k < TOGETHER; k++) {
                    /* The first frame fills missing places; their results are not read. */
                    places[j][axis][k] = positions[((begin + (k < some ? k : 0)) * joints + j) * 3 + axis];
                }
            }
        }
        for (Py_ssize_t p = 0; p < count; p++) {
            const double(*first)[TOGETHER] = places[pairs[2 * p]], (*second)[TOGETHER] = places[pairs[2 * p + 1]];
            double length[TOGETHER];
            for (int k = 0; k < TOGETHER; k++) {
                double x = first[0][k] - second[0][k], y = first[1][k] - second[1][k], z = first[2][k] - second[2][k];
                length[k] = sqrt(x * x + y * y + z * z);
            }
            for (Py_ssize_t k = 0; k < some; k++) {
                rows[(begin + k) * stride + p] = length[k];
            }
        }
    }
    return 0.0;
}

/* ---- sums that follow the rows of a window (stream.recognizer.windows.sums) -------------------------------------- */

/* Add rows at their times, with a weight, to sums (4, width): the reference, and of rows relative to it the sum, the sum
 * of products with time, and the sum of squares; and to a clock: the reference, the sum, the sum of squares. */
HELPER void KIND(add_rows)(double *restrict sums, Py_ssize_t width, double *restrict clock,
                           const double *restrict rows, Py_ssize_t stride, const double *restrict times, Py_ssize_t count,
                           double weight) {
    const double *restrict reference = sums;
    double *restrict sum = sums + width, *restrict along = sums + 2 * width, *restrict squares = sums + 3 * width;
    for (Py_ssize_t row = 0; row < count; row++) {
        const double *restrict numbers = rows + row * stride;
        const double time = times[row] - clock[0], weighed = weight * time;
        clock[1] += weighed;
        clock[2] += weighed * time;
        for (Py_ssize_t i = 0; i < width; i++) {
            double difference = numbers[i] - reference[i];
            sum[i] += weight * difference;
            squares[i] += weight * difference * difference;
            along[i] += weighed * difference;
        }
    }
}

/* Add points relative to a reference (width), with a weight, to their sum (width) and products (width, width). */
HELPER void KIND(add_products)(const double *restrict reference, double *restrict sum, double *restrict products,
                               int width, const double *restrict rows, Py_ssize_t stride, Py_ssize_t count,
                               double weight) {
    for (Py_ssize_t begin = 0; begin < count; begin += SOME_POINTS) {
        const Py_ssize_t some = count - begin < SOME_POINTS ? count - begin : SOME_POINTS;
        double relative[SOME_POINTS][MAX_DIRECTIONS] = {{0.0}};
        for (Py_ssize_t row = 0; row < some; row++) {
            for (int i = 0; i < width; i++) {
                relative[row][i] = rows[(begin + row) * stride + i] - reference[i];
                sum[i] += weight * relative[row][i];
            }
        }
        for (int i = 0; i < width; i++) {
            double added[MAX_DIRECTIONS] = {0.0};
            for (Py_ssize_t row = 0; row < some; row++) {
                const double factor = weight * relative[row][i];
                for (int j = 0; j < MAX_DIRECTIONS; j++) {
                    added[j] += factor * relative[row][j];
                }
            }
            for (int j = 0; j < width; j++) {
                products[i * width + j] += added[j];
            }
        }
    }
}

/* The sums of one span of a window: of moments, which have a clock, or of a covariance, which has products. */
typedef struct {
    const double *rows, *times;
    Py_ssize_t width, stride, *places; /* the span's begin and end, counted as if no row had moved back */
    double *drift, *reference, *sum, *clock, *products;
} KIND(Sums);

HELPER void KIND(add)(const KIND(Sums) *sums, Py_ssize_t begin, Py_ssize_t end, double weight) {
    const double *rows = sums->rows + begin * sums->stride;
    if (sums->clock != NULL) {
        KIND(add_rows)(sums->reference, sums->width, sums->clock, rows, sums->stride, sums->times + begin, end - begin, weight);
    } else {
        KIND(add_products)(sums->reference, sums->sum, sums->products, (int)sums->width, rows, sums->stride, end - begin, weight);
    }
}

/* The largest sum of squares, which bounds the rounding of all sums, and the scatter of `count` rows that is left in it. */
HELPER double KIND(scatter)(const KIND(Sums) *sums, double count, double *largest) {
    double square = 0.0;
    *largest = 0.0;
    if (sums->clock != NULL) {
        const double *squares = sums->sum + 2 * sums->width;
        Py_ssize_t place = 0;
        for (Py_ssize_t i = 1; i < sums->width; i++) {
            place = squares[i] > squares[place] ? i : place;
        }
        *largest = squares[place];
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
HELPER void KIND(begin)(const KIND(Sums) *sums, Py_ssize_t begin, Py_ssize_t end, double no_movement) {
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
    sums->drift[1] = no_movement * no_movement * (sums->clock != NULL ? mean * mean : square);
}

/* Add the rows that entered the span since the last call and subtract those that left it; 1 if all are added afresh. */
HELPER double KIND(follow_rows)(void *const *restrict array, const Py_ssize_t *restrict n, const double *restrict x,
                                int has_clock) {
    double *reference = array[4], *more = array[5];
    const KIND(Sums) all = {.rows = array[0], .times = array[1], .width = n[1], .stride = n[2], .places = array[2], .drift = array[3],
                            .reference = reference, .sum = reference + n[1], .clock = has_clock ? more : NULL,
                            .products = has_clock ? NULL : more};
    const KIND(Sums) *sums = &all;
    const double seconds = x[0], most = x[1], tolerance = x[2], no_movement = x[3];
    const Py_ssize_t end = (Py_ssize_t)x[4], moved = (Py_ssize_t)x[5], last = end - 1;
    if (end == 0) {
        return 0.0;
    }
    Py_ssize_t *places = sums->places;
    Py_ssize_t left = places[0] > moved ? places[0] - moved : 0, entered = places[1] > moved ? places[1] - moved : 0;
    left = left < last ? left : last;
    entered = entered < end ? entered : end;
    Py_ssize_t start = left;
    const double too_old = sums->times[last] - seconds;
    while (start < last && (sums->times[start] <= too_old || (double)(last - start) >= most)) {
        start++;
    }
    places[0] = start + moved;
    places[1] = end + moved;
    Py_ssize_t gone = entered < start ? entered : start;
    entered = entered > start ? entered : start;
    gone = gone > left ? gone : left;
    const Py_ssize_t new = end - entered, count = end - start;
    int afresh = new > 0 && new == count;
    double largest;
    if (new > 0 && !afresh) {
        KIND(add)(sums, entered, end, 1.0);
        KIND(add)(sums, left, gone, -1.0);
        const double scatter = KIND(scatter)(sums, (double)count, &largest);
        sums->drift[0] += DBL_EPSILON * (double)(new + gone - left) * largest;
        afresh = sums->drift[0] > tolerance * scatter;
    }
    if (afresh) {
        KIND(begin)(sums, start, end, no_movement);
        KIND(add)(sums, start, end, 1.0);
        KIND(scatter)(sums, (double)count, &largest);
        sums->drift[0] = DBL_EPSILON * (double)count * largest;
    }
    return afresh;
}

/* The moments of rows (rows, width) at times (rows). places (2), drift (2), sums (4, width): the reference, and of rows
 * relative to it the sum, the products with time, the squares; clock (3); n: rows, width, from one row to the next; x:
 * seconds and rows of the span at most, tolerance, no movement, end of the newest row, rows moved back. */
KERNEL(follow) { return KIND(follow_rows)(array, n, x, 1); }

/* The covariance of points: as `follow`, with sums (2, width), the reference and the sum, and products (width, width). */
KERNEL(follow_products) { return KIND(follow_rows)(array, n, x, 0); }

/* ---- parts of a signature (library.signature.parts) -------------------------------------------------------------- */

/* Spread, posture and trend of a window, and its movement, which is returned. sums (4, width) and clock (3) as in `follow`,
 * places (2); of the body sizing (width), segments (segments), above (segments, joints), ends (3, width); spread (width),
 * posture and trend (width, or 0 where they are not wanted); n: width, segments, joints, lengths of posture and of trend;
 * x: the noise's floor, the level removed. */
KERNEL(read_parts) {
    const Py_ssize_t width = n[0], between = n[1], joints = n[2], placed = n[3], trending = n[4];
    const double *restrict reference = array[0], *restrict sum = reference + width, *restrict along = sum + width;
    const double *restrict squares = along + width, *restrict clock = array[1], *restrict sizing = array[3];
    const double *restrict above = array[5], floor = x[0], level = x[1];
    const Py_ssize_t *restrict places = array[2], *restrict segments = array[4];
    const uint16_t *restrict ends = array[6];
    double *restrict spread = array[7], *restrict posture = array[8], *restrict trend = array[9];
    const double count = (double)(places[1] - places[0]);
    const double per_row = 1.0 / count, middle = clock[1] * per_row, swing = clock[2] * per_row - middle * middle;
    const double per_swing = swing > 0.0 ? 1.0 / sqrt(swing) : 0.0;
    double size = 0.0, means = 0.0, variances = 0.0, total = 0.0;
#pragma omp simd reduction(+ : size, means, variances)
    for (Py_ssize_t i = 0; i < width; i++) {
        const double offset = sum[i] * per_row, mean = reference[i] + offset;
        const double left = squares[i] * per_row - offset * offset, variance = left > 0.0 ? left : 0.0;
        size += mean * sizing[i];
        means += mean * mean;
        variances += variance;
        spread[i] = sqrt(variance);
    }
    /* A body in one point has no spread. */
    const double per_size = size > 0.0 ? 1.0 / size : 0.0, noise = floor * size;
    for (Py_ssize_t i = 0; trending && i < width; i++) {
        const double moved = spread[i] + noise, rising = (along[i] - sum[i] * middle) * per_row * per_swing;
        trend[i] = moved > 0.0 ? rising / moved : 0.0;
    }
    for (Py_ssize_t i = 0; i < width; i++) {
        const double number = spread[i] * per_size + floor;
        /* Of nothing and of negative numbers there is no logarithm. */
        spread[i] = number < DBL_MIN ? DBL_MIN : number;
    }
    Py_ssize_t begin = 0;
    for (; begin <= width - BYTES / 8; begin += BYTES / 8) {
        KIND(Doubles) *numbers = (KIND(Doubles) *)(spread + begin);
        *numbers = KIND(logs)(*numbers);
    }
    KIND(Doubles) left = {0.0};
    memcpy(&left, spread + begin, sizeof(double) * (size_t)(width - begin));
    left = KIND(logs)(left);
    memcpy(spread + begin, &left, sizeof(double) * (size_t)(width - begin));
#pragma omp simd reduction(+ : total)
    for (Py_ssize_t i = 0; i < width; i++) {
        total += spread[i];
    }
    const double removed = level * total / (double)width;
    for (Py_ssize_t i = 0; i < width; i++) {
        spread[i] -= removed;
    }
    double heights[MAX_JOINTS] = {0.0};
    for (Py_ssize_t s = 0; placed && s < between; s++) {
        const double length = reference[segments[s]] + sum[segments[s]] * per_row;
        for (Py_ssize_t j = 0; j < joints; j++) {
            heights[j] += length * above[s * joints + j];
        }
    }
    for (Py_ssize_t i = 0; placed && i < width; i++) {
        const double mean = reference[i] + sum[i] * per_row, down = 2 * heights[ends[2 * width + i]];
        const double length = between ? heights[ends[i]] + heights[ends[width + i]] - down : size;
        posture[i] = length > 0.0 ? mean / length : 0.0;
    }
    return means > 0.0 ? sqrt(variances / means) : 0.0;
}

/* Inner product of two vectors, so many registers wide. */
HELPER double KIND(dot)(const KIND(Doubles) *restrict one, const KIND(Doubles) *restrict other, int wide) {
    KIND(Doubles) sums = one[0] * other[0];
    for (int q = 1; q < wide; q++) {
        sums += one[q] * other[q];
    }
    double sum = 0.0;
#pragma omp simd reduction(+ : sum)
    for (int i = 0; i < BYTES / 8; i++) {
        sum += sums[i];
    }
    return sum;
}

/* Make a symmetric matrix, so many registers wide, tridiagonal by reflections I − factor v vᵀ (Householder), v in the matrix's
 * rows afterwards. */
HELPER void KIND(tridiagonal)(double (*restrict a)[MAX_DIRECTIONS], int size, int wide, double *restrict diagonal,
                              double *restrict off_diagonal, double *restrict factors) {
    for (int c = 0; c < size - 1; c++) {
        double *restrict v = a[c], numbers[MAX_DIRECTIONS];
        const KIND(Doubles) *restrict along = (const KIND(Doubles) *)v;
        /* In registers, which the compiler keeps them in only if they are written as such. */
        KIND(Doubles) image[WIDE] = {{0.0}};
        diagonal[c] = v[c];
        for (int i = 0; i <= c; i++) {
            v[i] = 0.0;
        }
        const double square = KIND(dot)(along, along, wide), first = v[c + 1], length = sqrt(square);
        off_diagonal[c] = first > 0.0 ? -length : length;
        factors[c] = square > 0.0 ? 1.0 / (square - first * off_diagonal[c]) : 0.0;
        v[c + 1] -= off_diagonal[c];
        for (int j = c + 1; j < size; j++) {
            const KIND(Doubles) *restrict row = (const KIND(Doubles) *)a[j];
            for (int q = 0; q < wide; q++) {
                image[q] += v[j] * row[q];
            }
        }
        const double half = factors[c] * KIND(dot)(along, image, wide) / 2;
        for (int q = 0; q < wide; q++) {
            image[q] = factors[c] * (image[q] - half * along[q]);
        }
        memcpy(numbers, image, sizeof numbers);
        for (int j = c + 1; j < size; j++) {
            KIND(Doubles) *restrict row = (KIND(Doubles) *)a[j];
            for (int q = 0; q < wide; q++) {
                row[q] -= v[j] * image[q] + numbers[j] * along[q];
            }
        }
    }
    diagonal[size - 1] = a[size - 1][size - 1];
    off_diagonal[size - 1] = 0.0;
}

/* Whether no eigenvalue of a tridiagonal matrix lies above a bound (Sturm; Givens 1954). */
HELPER int KIND(none_above)(const double *restrict d, const double *restrict e, int size, double bound) {
    double left = d[0] - bound;
    for (int i = 1; i < size && left <= 0.0; i++) {
        left = d[i] - bound - e[i - 1] * e[i - 1] / left;
    }
    return left <= 0.0;
}

/* Find about where the largest eigenvalues of a tridiagonal matrix of trace 1 lie, by counting how many are above some
 * bounds: SECTIONS for each eigenvalue. */
HELPER void KIND(locate)(const double *restrict d, const double *restrict e, int size, float *restrict located) {
    float low[EIGENVECTORS] = {0.0F}, width = 1.0F;
    for (int pass = 0; pass < PASSES; pass++) {
        float bounds[BOUNDS], left[BOUNDS], counts[BOUNDS];
        width /= SECTIONS + 1;
        for (int b = 0; b < BOUNDS; b++) {
            bounds[b] = low[b / SECTIONS] + (float)(b % SECTIONS + 1) * width;
            left[b] = INFINITY;
            counts[b] = 0.0F;
        }
        for (int i = 0; i < size; i++) {
            const float diagonal = (float)d[i], square = i > 0 ? (float)(e[i - 1] * e[i - 1]) + FLT_MIN : 0.0F;
            for (int b = 0; b < BOUNDS; b++) {
                left[b] = diagonal - bounds[b] - square / left[b];
                counts[b] += left[b] > 0.0F ? 1.0F : 0.0F;
            }
        }
        for (int b = 0; b < BOUNDS; b++) {
            low[b / SECTIONS] += counts[b] > (float)(b / SECTIONS) ? width : 0.0F;
        }
    }
    for (int k = 0; k < EIGENVECTORS; k++) {
        located[k] = low[k] + width / 2;
    }
}

/* Find eigenvalues of a tridiagonal matrix of trace 1, to its diagonal, until so many of them are found as `located` and
 * none that is left is above; and their eigenvectors, to rows that begin as those of 1, so many registers wide: implicit QL
 * (Dubrulle, Martin and Wilkinson 1968). Gives how many were found; 0 if it does not end, as with what is no number. */
HELPER int KIND(diagonal)(double *restrict d, double *restrict e, int size, int wide, const float *restrict located, int wanted,
                          double (*restrict rows)[MAX_DIRECTIONS]) {
    for (int low = 0; low < size; low++) {
        for (int turn = 0;; turn++) {
            int high = low;
            while (high < size - 1 && !(fabs(e[high]) <= NO_EIGENVALUE)) {
                high++;
            }
            if (high == low) {
                break;
            }
            if (turn == MAX_TURNS) {
                return 0;
            }
            const double shift = (d[low + 1] - d[low]) / (2 * e[low]), root = sqrt(shift * shift + 1);
            const double near = d[low] - e[low] / (shift + (shift < 0 ? -root : root));
            double g = d[high] - (turn == 0 && low < wanted && located ? (double)located[low] : near), sine = 1, cosine = 1, p = 0;
            int i = high - 1;
            for (; i >= low; i--) {
                const double f = sine * e[i], b = cosine * e[i], square = f * f + g * g, r = sqrt(square);
                e[i + 1] = r;
                if (r == 0.0) {
                    d[i + 1] -= p;
                    break;
                }
                /* A root and a quotient side by side are quicker than one after the other. */
                sine = f * (r * (1 / square));
                cosine = g * (r * (1 / square));
                g = d[i + 1] - p;
                const double s = (d[i] - g) * sine + 2 * cosine * b;
                p = sine * s;
                d[i + 1] = g + p;
                g = cosine * s - b;
                for (int k = 0; k < wide * BYTES / 8; k++) {
                    const double one = rows[i + 1][k], other = rows[i][k];
                    rows[i + 1][k] = sine * other + cosine * one;
                    rows[i][k] = cosine * other - sine * one;
                }
            }
            if (i < low) {
                d[low] -= p;
                e[low] = g;
            }
            e[high] = 0.0;
        }
        if (low + 1 >= wanted && low + 1 < size) {
            double least = d[0];
            for (int i = 1; i <= low; i++) {
                least = d[i] < least ? d[i] : least;
            }
            if (KIND(none_above)(d + low + 1, e + low + 1, size - low - 1, least)) {
                return low + 1;
            }
        }
    }
    return size;
}

/* The largest eigenvalues of a covariance (size, size), to values (count), and their eigenvectors, to (count, size): of one so
 * many registers wide. */
HELPER int KIND(pairs)(const double *restrict covariance, int size, int wide, int count, double *restrict values,
                       double *restrict vectors) {
    double a[MAX_DIRECTIONS][MAX_DIRECTIONS] __attribute__((aligned(LINE))) = {{0.0}};
    double rows[MAX_DIRECTIONS][MAX_DIRECTIONS] __attribute__((aligned(LINE))) = {{0.0}};
    double d[MAX_DIRECTIONS], e[MAX_DIRECTIONS], factors[MAX_DIRECTIONS], trace = 0.0;
    float located[EIGENVECTORS];
    for (int i = 0; i < size; i++) {
        trace += covariance[i * size + i];
    }
    const double per_trace = trace > 0.0 ? 1.0 / trace : 0.0;
    for (int i = 0; i < size; i++) {
        for (int j = 0; j < size; j++) {
            a[i][j] = covariance[i * size + j] * per_trace;
        }
        rows[i][i] = 1.0;
    }
    KIND(tridiagonal)(a, size, wide, d, e, factors);
    if (wide == WIDE) {
        KIND(locate)(d, e, size, located);
    }
    const int found = KIND(diagonal)(d, e, size, wide, wide == WIDE ? located : NULL, count, rows);
    if (found == 0) {
        return 0;
    }
    for (int k = 0; k < count; k++, vectors += size) {
        int largest = 0;
        for (int i = 1; i < found; i++) {
            largest = d[i] > d[largest] ? i : largest;
        }
        values[k] = d[largest] * trace;
        d[largest] = -INFINITY;
        KIND(Doubles) *restrict row = (KIND(Doubles) *)rows[largest];
        for (int c = size - 2; c >= 0; c--) {
            const KIND(Doubles) *restrict v = (const KIND(Doubles) *)a[c];
            const double product = factors[c] * KIND(dot)(v, row, wide);
            for (int q = 0; q < wide; q++) {
                row[q] -= product * v[q];
            }
        }
        memcpy(vectors, row, sizeof(double) * (size_t)size);
    }
    return 1;
}

/* The largest eigenvalues of covariances and their eigenvectors; 0 where a matrix holds NaN or infinity. covariances
 * (matrices, size, size), values (matrices, k), vectors (matrices, k, size); n: matrices, size, k. */
KERNEL(eigenpairs) {
    const double *covariances = array[0];
    double *values = array[1], *vectors = array[2];
    (void)x;
    for (Py_ssize_t m = 0; m < n[0]; m++) {
        if (!KIND(pairs)(covariances + m * n[1] * n[1], (int)n[1], WIDE, (int)n[2], values + m * n[2], vectors + m * n[2] * n[1])) {
            return 0.0;
        }
    }
    return 1.0;
}

/* Multiply a matrix (size, width) with some vectors side by side (width, BLOCK); rows of which some sums are in registers
 * at once. */
HELPER void KIND(multiply)(const double *restrict matrix, int size, int width, double (*restrict vectors)[BLOCK],
                           double (*restrict products)[BLOCK]) {
    for (int begin = 0; begin < size; begin += ROWS) {
        const int step = begin + ROWS <= size ? width : 0;
        KIND(Doubles) sums[ROWS][BLOCK_WIDE] = {{{0.0}}};
        for (int j = 0; j < width; j++) {
            const KIND(Doubles) *restrict row = (const KIND(Doubles) *)vectors[j];
            for (int r = 0; r < ROWS; r++) {
                for (int q = 0; q < BLOCK_WIDE; q++) {
                    sums[r][q] += matrix[begin * width + r * step + j] * row[q];
                }
            }
        }
        memcpy(products[begin], sums, sizeof(double) * BLOCK * (size_t)(step ? ROWS : 1));
        begin -= step ? 0 : ROWS - 1;
    }
}

/* Inner products of the vectors in one block with those in another, both (size, BLOCK). */
HELPER void KIND(products)(double (*one)[BLOCK], double (*other)[BLOCK], int size,
                           double (*restrict products)[BLOCK]) {
    KIND(Doubles) sums[BLOCK][BLOCK_WIDE] = {{{0.0}}};
    for (int i = 0; i < size; i++) {
        const KIND(Doubles) *restrict row = (const KIND(Doubles) *)other[i];
        for (int b = 0; b < BLOCK; b++) {
            for (int q = 0; q < BLOCK_WIDE; q++) {
                sums[b][q] += one[i][b] * row[q];
            }
        }
    }
    memcpy(products, sums, sizeof sums);
}

/* Make a block (size, BLOCK) orthonormal, to `vectors`, by the Cholesky factor of its inner products; 0 where the vectors are
 * dependent. */
HELPER int KIND(orthonormal)(double (*restrict block)[BLOCK], int size, double (*restrict vectors)[BLOCK]) {
    double products[BLOCK][BLOCK], inverse[BLOCK][BLOCK] = {{0.0}};
    KIND(products)(block, block, size, products);
    for (int k = 0; k < BLOCK; k++) {
        inverse[k][k] = 1.0;
    }
    /* Elimination turns the products into the factor, and what was 1 into its inverse, column by column. */
    for (int k = 0; k < BLOCK; k++) {
        if (!(products[k][k] > 0.0)) {
            return 0;
        }
        const double factor = 1.0 / sqrt(products[k][k]);
        for (int i = 0; i < BLOCK; i++) {
            products[k][i] *= factor;
            inverse[i][k] *= factor;
        }
        for (int m = k + 1; m < BLOCK; m++) {
            const double along = products[k][m];
            for (int i = 0; i < BLOCK; i++) {
                products[m][i] -= along * products[k][i];
                inverse[i][m] -= along * inverse[i][k];
            }
        }
    }
    KIND(multiply)(block[0], size, BLOCK, inverse, vectors);
    return 1;
}

/* The largest eigenvalues of a covariance and their eigenvectors, as `eigenpairs` finds them, from a block (size, BLOCK) that
 * held those of a covariance much like it: subspace iteration (Rutishauser 1969). 0 where this does not find them: the
 * residuals stay large, or the trace leaves room for another eigenvalue as large. */
HELPER int KIND(iterate)(const double *restrict covariance, int size, double trace, double *restrict values,
                         double *restrict vectors, double (*restrict block)[BLOCK]) {
    double now[MAX_DIRECTIONS][BLOCK], next[MAX_DIRECTIONS][BLOCK], inside[BLOCK][BLOCK], few[EIGENVECTORS][BLOCK];
    double columns[BLOCK][BLOCK] = {{0.0}}, found[MAX_DIRECTIONS][BLOCK], images[MAX_DIRECTIONS][BLOCK];
    memcpy(now, block, sizeof(double) * (size_t)(size * BLOCK));
    for (int turn = 1; turn <= MAX_ITERATIONS; turn++) {
        KIND(multiply)(covariance, size, size, now, next);
        if (turn == ITERATIONS || turn == MAX_ITERATIONS) {
            KIND(products)(now, next, size, inside);
            double left = trace, largest = 0.0;
            for (int b = 0; b < BLOCK; b++) {
                left -= inside[b][b];
            }
            if (!KIND(pairs)(inside[0], BLOCK, BLOCK_WIDE, EIGENVECTORS, values, few[0])) {
                return 0;
            }
            for (int k = 0; k < EIGENVECTORS; k++) {
                for (int b = 0; b < BLOCK; b++) {
                    columns[b][k] = few[k][b];
                }
            }
            KIND(multiply)(now[0], size, BLOCK, columns, found);
            KIND(multiply)(next[0], size, BLOCK, columns, images);
            for (int k = 0; k < EIGENVECTORS; k++) {
                double square = 0.0;
                for (int i = 0; i < size; i++) {
                    const double residual = images[i][k] - values[k] * found[i][k];
                    square += residual * residual;
                    vectors[k * size + i] = found[i][k];
                }
                largest = square > largest ? square : largest;
            }
            if (left <= values[EIGENVECTORS - 1] && largest <= NO_RESIDUAL * trace * (NO_RESIDUAL * trace)) {
                memcpy(block, now, sizeof(double) * (size_t)(size * BLOCK));
                return 1;
            }
        }
        /* Two products leave the vectors independent enough. */
        if (turn % 2 != 0) {
            memcpy(now, next, sizeof(double) * (size_t)(size * BLOCK));
        } else if (!KIND(orthonormal)(next, size, now)) {
            return 0;
        }
    }
    return 0;
}

/* The eigenpairs of a window and its part `eigen`, scaled; gives the covariance's trace, NaN where a number is not finite.
 * sums (2, size), products (size, size), places (2) and drift (2) as in `follow_products`; values (k), vectors and scaled (k,
 * size); block (size, BLOCK), at first 0; n: size, k. */
KERNEL(read_eigen) {
    const int size = (int)n[0], most = (int)n[1];
    const Py_ssize_t *places = array[2];
    const double *sum = (const double *)array[0] + size, *products = array[1], *drift = array[3], each = 1.0 / (double)(places[1] - places[0]);
    double covariance[MAX_DIRECTIONS * MAX_DIRECTIONS], trace = 0.0, total = 0.0;
    double *restrict values = array[4], *restrict vectors = array[5], *restrict scaled = array[6];
    double(*block)[BLOCK] = array[7];
    (void)x;
    for (int i = 0; i < size; i++) {
        for (int j = 0; j < size; j++) {
            covariance[i * size + j] = products[i * size + j] * each - sum[i] * each * (sum[j] * each);
        }
        trace += covariance[i * size + i];
    }
    /* Nothing of it is left where there is hardly any. */
    if (trace <= drift[1]) {
        memset(covariance, 0, sizeof covariance);
        trace = 0.0;
    }
    /* The block takes what is found over to the next time. */
    const int again = size >= 2 * BLOCK && most >= EIGENVECTORS && trace > 0.0;
    if (!again || !KIND(iterate)(covariance, size, trace, values, vectors, block)) {
        if (!KIND(pairs)(covariance, size, WIDE, most, values, vectors)) {
            return (double)NAN;
        }
        /* The other vectors of a new block may be any. */
        for (int i = 0; i < size && again; i++) {
            for (int b = 0; b < BLOCK; b++) {
                block[i][b] = b < EIGENVECTORS ? vectors[b * size + i] : i == b ? 1.0 : 0.0;
            }
        }
    }
    for (int k = 0; k < most; k++) {
        total += values[k] > 0.0 ? values[k] : 0.0;
    }
    for (int k = 0; k < most; k++) {
        const double root = values[k] > 0.0 ? sqrt(sqrt(values[k] / total)) : 0.0;
        for (int i = 0; i < size; i++) {
            scaled[k * size + i] = root * vectors[k * size + i];
        }
    }
    return trace;
}

/* ---- windows compared (library.windows.index) -------------------------------------------------------------------- */

/* Add a factor times a lane of halves to sums. */
HELPER void KIND(add_lane)(const Half *restrict lane, float factor, KIND(Floats) *restrict sums) {
    for (int j = 0; j < LANE / FLOATS; j++) {
        sums[j] += factor * KIND(widen)(lane + FLOATS * j);
    }
}

/* Map numbers by a metric: (numbers − origin) axes. numbers (numbers), origin (numbers), axes (numbers, a multiple of LANE),
 * vector (kept); n: numbers, from one number's axes to the next, kept. */
KERNEL(place) {
    const double *restrict numbers = array[0];
    const float *restrict origin = array[1];
    const Half *restrict axes = array[2];
    double *restrict vector = array[3];
    (void)x;
    for (Py_ssize_t begin = 0; begin < n[2]; begin += LANE) {
        KIND(Floats) sums[LANE / FLOATS] = {{0.0F}};
        for (Py_ssize_t i = 0; i < n[0]; i++) {
            KIND(add_lane)(axes + i * n[1] + begin, (float)numbers[i] - origin[i], sums);
        }
        for (Py_ssize_t k = 0; k < LANE && begin + k < n[2]; k++) {
            vector[begin + k] = (double)((float *)sums)[k];
        }
    }
    return 0.0;
}

/* Parts compared as one vector of so many axes, or as the matrices of so many scaled eigenvectors (0: a vector). */
typedef struct {
    Py_ssize_t axes, eigenvectors;
    const Half *windows;  /* (lanes, axes or eigenvectors * axes, LANE) */
    const float *lengths; /* |b|² + nearest, (lanes, LANE) */
} KIND(Group);

/* Squared distances of one lane of windows to a vector, given times −2, and a little more. */
HELPER void KIND(distances_to)(const KIND(Group) *group, Py_ssize_t lane, const float *restrict vector, float square,
                               float *restrict squared) {
    const Half *windows = group->windows + lane * group->axes * LANE;
    const float *lengths = group->lengths + lane * LANE;
    KIND(Floats) sums[LANE / FLOATS];
    for (int j = 0; j < LANE / FLOATS; j++) {
        sums[j] = *(const KIND(Floats) *)(lengths + FLOATS * j) + square;
    }
    for (Py_ssize_t k = 0; k < group->axes; k++) {
        KIND(add_lane)(windows + k * LANE, vector[k], sums);
    }
    memcpy(squared, sums, sizeof sums);
}

/* The same of scaled eigenvectors (count, axes), whose matrix is of length 1: 1 + 1 − 2 Σᵢⱼ ⟨sᵢ, tⱼ⟩². */
HELPER void KIND(distances_between)(const KIND(Group) *group, int count, Py_ssize_t lane, const float *restrict scaled,
                                    float *restrict squared) {
    for (int begin = 0; begin < LANE / FLOATS; begin += REGISTERS) {
        const Half *windows = group->windows + lane * count * group->axes * LANE + FLOATS * begin;
        KIND(Floats) squares[REGISTERS] = {{0.0F}};
        for (int i = 0; i < count; i++) {
            KIND(Floats) products[EIGENVECTORS][REGISTERS] = {{{0.0F}}};
            for (Py_ssize_t k = 0; k < group->axes; k++, windows += LANE) {
                for (int j = 0; j < REGISTERS; j++) {
                    const KIND(Floats) window = KIND(widen)(windows + FLOATS * j);
                    for (int q = 0; q < count; q++) {
                        products[q][j] += scaled[q * group->axes + k] * window;
                    }
                }
            }
            for (int q = 0; q < count; q++) {
                for (int j = 0; j < REGISTERS; j++) {
                    squares[j] += products[q][j] * products[q][j];
                }
            }
        }
        for (int j = 0; j < REGISTERS; j++) {
            const Py_ssize_t place = lane * LANE + FLOATS * (begin + j);
            const KIND(Floats) lengths = *(const KIND(Floats) *)(group->lengths + place);
            *(KIND(Floats) *)(squared + FLOATS * (begin + j)) = 1.0F + lengths - 2.0F * squares[j];
        }
    }
}

/* The least of numbers from `begin` to before `end`, at least one: some twenty, as a person has windows of a class. */
HELPER float KIND(least)(const float *restrict numbers, Py_ssize_t begin, Py_ssize_t end) {
    float least = numbers[begin], each[FLOATS];
    if (end - begin < FLOATS) {
        for (Py_ssize_t i = begin + 1; i < end; i++) {
            least = numbers[i] < least ? numbers[i] : least;
        }
        return least;
    }
    /* Register by register; the last one overlaps with the one before. */
#pragma omp simd
    for (int j = 0; j < FLOATS; j++) {
        each[j] = numbers[end - FLOATS + j];
    }
    for (Py_ssize_t i = begin; i < end - FLOATS; i += FLOATS) {
#pragma omp simd
        for (int j = 0; j < FLOATS; j++) {
            each[j] = numbers[i + j] < each[j] ? numbers[i + j] : each[j];
        }
    }
#pragma omp simd reduction(min : least)
    for (int j = 0; j < FLOATS; j++) {
        least = each[j] < least ? each[j] : least;
    }
    return least;
}

/* Compare a live window with all windows of a library. groups (groups, 4): axes, eigenvectors or 0, where its vector and its
 * windows begin; windows; lengths (groups, windows of all lanes); weights (views, groups); block_starts (blocks + 1): where
 * each person's windows in each class start; class_starts (classes + 1): where each class's blocks start; vectors; products
 * (views, windows of all lanes), to work on; logs (views, classes); named (classes), the least of the first views; n: groups,
 * halves, windows of all lanes, views, blocks + 1, classes + 1, numbers of all vectors, classes; x: the least squared distance,
 * whether negative |inner products| are weighed in place of log distances, and how many views name. */
KERNEL(compare) {
    const Py_ssize_t *restrict groups = array[0], *restrict block_starts = array[4], *restrict class_starts = array[5];
    const float *restrict weights = array[3], nearest = (float)x[0];
    const int by_products = x[1] != 0.0;
    const double *restrict live = array[6];
    float *restrict products = array[7];
    double *restrict logs = array[8], *restrict named = array[9];
    const Py_ssize_t count = n[0], every = n[2], views = n[3], classes = n[7];
    float vectors[MAX_PARTS][MAX_AXES], squares[MAX_PARTS] = {0.0F};
    KIND(Group) group[MAX_PARTS];
    for (Py_ssize_t g = 0; g < count; g++) {
        const Py_ssize_t axes = groups[4 * g], eigenvectors = groups[4 * g + 1];
        group[g] = (KIND(Group)){.axes = axes, .eigenvectors = eigenvectors, .windows = (const Half *)array[1] + groups[4 * g + 3],
                                 .lengths = (const float *)array[2] + g * every};
        for (Py_ssize_t i = 0; i < axes * (eigenvectors ? eigenvectors : 1); i++) {
            vectors[g][i] = (float)live[groups[4 * g + 2] + i];
        }
        /* |a − b|² = |a|² − 2 a b + |b|². */
        for (Py_ssize_t i = 0; i < axes && !eigenvectors; i++) {
            squares[g] += vectors[g][i] * vectors[g][i];
            vectors[g][i] *= -2.0F;
        }
    }
    for (Py_ssize_t lane = 0; lane < every / LANE; lane++) {
        KIND(Floats) logs_of[MAX_PARTS][LANE / FLOATS];
        float squared[LANE];
        for (Py_ssize_t g = 0; g < count; g++) {
            if (group[g].eigenvectors == EIGENVECTORS) {
                KIND(distances_between)(&group[g], EIGENVECTORS, lane, vectors[g], squared);
            } else if (group[g].eigenvectors) {
                KIND(distances_between)(&group[g], (int)group[g].eigenvectors, lane, vectors[g], squared);
            } else {
                KIND(distances_to)(&group[g], lane, vectors[g], squares[g], squared);
            }
            /* NaN counts as the farthest. */
            for (int w = 0; w < LANE; w++) {
                const float one = squared[w] < FARTHEST ? squared[w] : FARTHEST;
                squared[w] = one > nearest ? one : nearest;
            }
            for (int w = 0; w < LANE && by_products; w++) {
                squared[w] = -sqrtf(squared[w] < 2.0F ? 1.0F - squared[w] / 2.0F : 0.0F);
            }
            for (int j = 0; j < LANE / FLOATS; j++) {
                const KIND(Floats) each = *(KIND(Floats) *)(squared + FLOATS * j);
                logs_of[g][j] = by_products ? each : KIND(float_logs)(each);
            }
        }
        for (Py_ssize_t v = 0; v < views; v++) {
            KIND(Floats) sums[LANE / FLOATS] = {{0.0F}};
            for (Py_ssize_t g = 0; g < count; g++) {
                const float weight = weights[v * count + g];
                for (int j = 0; j < LANE / FLOATS && weight != 0.0F; j++) {
                    sums[j] += weight * logs_of[g][j];
                }
            }
            memcpy(products + v * every + lane * LANE, sums, sizeof sums);
        }
    }
    /* For each view and class the mean of the two least numbers that different people's windows have in it. */
    for (Py_ssize_t v = 0; v < views; v++) {
        for (Py_ssize_t c = 0; c < classes; c++) {
            const Py_ssize_t begin = class_starts[c], end = class_starts[c + 1];
            float first = INFINITY, second = INFINITY;
            for (Py_ssize_t b = begin; b < end; b++) {
                const float least = KIND(least)(products + v * every, block_starts[b], block_starts[b + 1]);
                const float larger = least < first ? first : least;
                second = larger < second ? larger : second;
                first = least < first ? least : first;
            }
            const double agreed = ((double)first + (double)(end - begin < 2 ? first : second)) / 2.0;
            logs[v * classes + c] = agreed;
            named[c] = v == 0 || ((double)v < x[2] && agreed < named[c]) ? agreed : named[c];
        }
    }
    return 0.0;
}

/* Each class's best |inner product| of its windows' leading eigenvectors with another. windows (lanes, directions, LANE);
 * products (windows of all lanes), to work on; starts (classes + 1): where each class's windows start; eigenvector
 * (directions), scores (classes); n: lanes, directions, LANE, windows of all lanes, classes + 1, classes. */
KERNEL(scores) {
    const float *restrict all = array[0];
    float *restrict products = array[1];
    const Py_ssize_t *restrict starts = array[2];
    const double *restrict eigenvector = array[3];
    double *restrict scores = array[4];
    (void)x;
    for (Py_ssize_t lane = 0; lane < n[0]; lane++) {
        const float *restrict windows = all + lane * n[1] * LANE;
        float sums[LANE] = {0.0F};
        for (Py_ssize_t k = 0; k < n[1]; k++) {
            const float factor = (float)eigenvector[k];
            for (int w = 0; w < LANE; w++) {
                sums[w] += factor * windows[k * LANE + w];
            }
        }
        /* Below 0, for the least. */
        for (int w = 0; w < LANE; w++) {
            products[lane * LANE + w] = -fabsf(sums[w]);
        }
    }
    for (Py_ssize_t c = 0; c < n[5]; c++) {
        scores[c] = -(double)KIND(least)(products, starts[c], starts[c + 1]);
    }
    return 0.0;
}

/* ---- how far a motion is (stream.recognizer.progress) ------------------------------------------------------------ */

/* e to the power of numbers: eˣ = 2ⁿ eʳ with |r| ≤ ln 2 / 2. Below −87 it is e⁻⁸⁷, as good as 0; no number is above 0. */
HELPER KIND(Floats) KIND(float_exps)(KIND(Floats) numbers) {
    union {
        KIND(Ints) bits;
        KIND(Floats) whole;
    } power;
    const KIND(Floats) least = numbers * 0 - 87.0F;
    const KIND(Ints) enough = numbers > least;
    power.whole = numbers;
    power.bits = (power.bits & enough) | ((KIND(Ints))least & ~enough);
    const KIND(Floats) x = power.whole;
    /* No number is above 0, and a conversion rounds towards 0. */
    const KIND(Ints) n = __builtin_convertvector(x * 1.44269504F - 0.5F, KIND(Ints));
    const KIND(Floats) whole = __builtin_convertvector(n, KIND(Floats));
    const KIND(Floats) r = (x - whole * 0.693359375F) + whole * 2.12194440e-4F;
    KIND(Floats) series = r * 0 + 1.0F / 5040.0F;
    for (int place = 6; place >= 0; place--) {
        static const float terms[] = {1.0F, 1.0F, 0.5F, 1.0F / 6.0F, 1.0F / 24.0F, 1.0F / 120.0F, 1.0F / 720.0F};
        series = series * r + terms[place];
    }
    power.bits = (n + 127) << 23;
    return series * power.whole;
}

/* Take one step of the filter. course (4, moments): phases, the probabilities of beginning there and of a next round, one
 * over the moments in the bin; indices (2, moments): bins, and the moments by their phase; starts (recordings); vectors
 * (axes, moments), lengths (moments); expected (rows, moments); constants (8): how probable a step by 0, 1 and 2 is, a
 * change, a beginning, a next round, the weight of a squared distance, which phases are near; live (axes); belief
 * (moments), after (moments) and room (moments + a register) to work on; found (2 + rows): the phase below which half the
 * probability lies, the probability near it, and the means of the rows; n: moments, recordings, axes, rows. */
KERNEL(follow_phase) {
    const Py_ssize_t count = n[0], recordings = n[1], *restrict bins = array[1], *restrict order = bins + count;
    const Py_ssize_t *restrict starts = array[2];
    const double *restrict phases = array[0], *restrict beginning = phases + count, *restrict rounds = beginning + count;
    const double *restrict alike = rounds + count, *restrict expected = array[5], *restrict constants = array[6];
    const double stay = constants[0], one = constants[1], two = constants[2], changes = constants[3], begins = constants[4];
    const double again = constants[5], far = constants[7], keeps = 1.0 - changes - begins;
    const float *restrict vectors = array[3], *restrict lengths = array[4], *restrict live = array[7];
    const float sharpness = -0.5F * (float)constants[6];
    double *restrict belief = array[8], *restrict after = array[9], *restrict found = array[11];
    float *restrict room = array[10], least = INFINITY;
    double mass[MAX_BINS] = {0.0}, beyond = 0.0, total = 0.0, below = 0.0, near = 0.0;
    (void)x;
    /* The probability of every moment goes on by one step. */
    for (Py_ssize_t r = 0; r < recordings; r++) {
        const Py_ssize_t begin = starts[r], last = (r + 1 < recordings ? starts[r + 1] : count) - 1;
        after[begin] = stay * belief[begin];
        if (last > begin) {
            after[begin + 1] = stay * belief[begin + 1] + one * belief[begin];
        }
        for (Py_ssize_t i = begin + 2; i <= last; i++) {
            after[i] = stay * belief[i] + one * belief[i - 1] + two * belief[i - 2];
        }
        const double over = (one + two) * belief[last] + (last > begin ? two * belief[last - 1] : 0.0);
        after[last] += over * (1.0 - again);
        beyond += over;
    }
    beyond *= again;
    for (Py_ssize_t i = 0; i < count; i++) {
        after[i] += beyond * rounds[i];
        mass[bins[i]] += after[i];
    }
    for (Py_ssize_t i = 0; i < count; i++) {
        after[i] = keeps * after[i] + changes * alike[i] * mass[bins[i]] + begins * beginning[i];
    }
    /* Every moment is weighed by how alike the live one is. */
    memcpy(room, lengths, sizeof(float) * (size_t)count);
    for (Py_ssize_t k = 0; k < n[2]; k++) {
        const float *restrict axis = vectors + k * count;
        const float factor = -2.0F * live[k];
        for (Py_ssize_t i = 0; i < count; i++) {
            room[i] += factor * axis[i];
        }
    }
#pragma omp simd reduction(min : least)
    for (Py_ssize_t i = 0; i < count; i++) {
        least = room[i] < least ? room[i] : least;
    }
    for (Py_ssize_t i = 0; i < count; i += FLOATS) {
        KIND(Floats) *some = (KIND(Floats) *)(room + i);
        *some = KIND(float_exps)(sharpness * (*some - least));
    }
#pragma omp simd reduction(+ : total)
    for (Py_ssize_t i = 0; i < count; i++) {
        after[i] *= (double)room[i];
        total += after[i];
    }
    const double factor = total > 0.0 ? 1.0 / total : 0.0;
    for (Py_ssize_t i = 0; i < count; i++) {
        belief[i] = total > 0.0 ? after[i] * factor : beginning[i];
    }
    Py_ssize_t place = 0;
    for (; place < count - 1; place++) {
        below += belief[order[place]];
        if (below >= 0.5) {
            break;
        }
    }
    const double phase = phases[order[place]];
#pragma omp simd reduction(+ : near)
    for (Py_ssize_t i = 0; i < count; i++) {
        near += fabs(phases[i] - phase) <= far ? belief[i] : 0.0;
    }
    found[0] = phase;
    found[1] = near;
    for (Py_ssize_t row = 0; row < n[3]; row++) {
        const double *restrict numbers = expected + row * count;
        double mean = 0.0;
#pragma omp simd reduction(+ : mean)
        for (Py_ssize_t i = 0; i < count; i++) {
            mean += belief[i] * numbers[i];
        }
        found[2 + row] = mean;
    }
    return 0.0;
}

/* Where a body is and how it moves, whitened. points (points, directions), whitening (2 directions, axes), live (axes), found
 * (2): the squared length of the velocity, the summed variance of the points; n: points, directions, rows of the whitening,
 * axes, from one point to the next; x: the factor on the velocity, begin and end of the points that count, and the points
 * before the newest at which the velocity begins. */
KERNEL(moving) {
    const Py_ssize_t begin_at = (Py_ssize_t)x[1], count = (Py_ssize_t)x[2] - begin_at, directions = n[1], width = n[3];
    const Py_ssize_t stride = n[4], back = (Py_ssize_t)x[3] < count ? (Py_ssize_t)x[3] : count - 1;
    const double *restrict points = (const double *)array[0] + begin_at * stride, *restrict whitening = array[1];
    const double factor = x[0];
    float *restrict live = array[2];
    double *restrict found = array[3];
    if (count < 1) {
        return 0.0;
    }
    const double *restrict now = points + (count - 1) * stride, *restrict before = now - back * stride;
    double vector[2 * MAX_DIRECTIONS], mean[MAX_DIRECTIONS] = {0.0}, squares[MAX_DIRECTIONS] = {0.0};
    found[0] = found[1] = 0.0;
    for (Py_ssize_t d = 0; d < directions; d++) {
        const double velocity = factor * (now[d] - before[d]);
        vector[d] = now[d];
        vector[directions + d] = velocity;
        found[0] += velocity * velocity;
    }
    for (Py_ssize_t p = 0; p < count; p++) {
        for (Py_ssize_t d = 0; d < directions; d++) {
            mean[d] += points[p * stride + d] / (double)count;
        }
    }
    for (Py_ssize_t p = 0; p < count; p++) {
        for (Py_ssize_t d = 0; d < directions; d++) {
            const double deviation = points[p * stride + d] - mean[d];
            squares[d] += deviation * deviation;
        }
    }
    for (Py_ssize_t d = 0; d < directions; d++) {
        found[1] += squares[d] / (double)count;
    }
    for (Py_ssize_t begin = 0; begin < width; begin += MAX_DIRECTIONS) {
        const Py_ssize_t some = width - begin < MAX_DIRECTIONS ? width - begin : MAX_DIRECTIONS;
        double sums[MAX_DIRECTIONS] = {0.0};
        for (Py_ssize_t d = 0; d < 2 * directions; d++) {
            for (Py_ssize_t k = 0; k < some; k++) {
                sums[k] += vector[d] * whitening[d * width + begin + k];
            }
        }
        for (Py_ssize_t k = 0; k < some; k++) {
            live[begin + k] = (float)sums[k];
        }
    }
    return 0.0;
}

/* ---- which joints can be believed (stream.recognizer.joints.plausibility) ----------------------------------------- */

/* The steps of joints from frame to frame, the first from `last`; gives the largest sum of squares of a frame's steps about
 * their mean, NaN if there is one. positions (frames, joints, 3), last (joints, 3), steps (frames, joints, 3), farthest (1): the
 * largest squared sum of a frame's steps; n: frames, joints; x: frames. */
KERNEL(steps) {
    const double *restrict positions = array[0], *restrict last = array[1];
    double *restrict steps = array[2], *restrict farthest = array[3];
    const Py_ssize_t frames = (Py_ssize_t)x[0], joints = n[1];
    double largest = 0.0;
    *farthest = 0.0;
    for (Py_ssize_t f = 0; f < frames; f++) {
        const double *restrict now = positions + f * joints * 3;
        const double *restrict before = f > 0 ? now - joints * 3 : last;
        double *restrict step = steps + f * joints * 3, sums[3] = {0.0}, squares[3] = {0.0};
        for (Py_ssize_t j = 0; j < joints; j++) {
            for (int axis = 0; axis < 3; axis++) {
                const double difference = now[3 * j + axis] - before[3 * j + axis];
                step[3 * j + axis] = difference;
                sums[axis] += difference;
                squares[axis] += difference * difference;
            }
        }
        double about_mean = 0.0, way = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            way += sums[axis] * sums[axis];
            about_mean += squares[axis] - sums[axis] * sums[axis] / (double)joints;
        }
        *farthest = way > *farthest || way != way ? way : *farthest;
        largest = about_mean > largest || about_mean != about_mean ? about_mean : largest;
    }
    return largest;
}

#undef HELPER
#undef KERNEL
#undef BYTES
#undef FLOATS
#undef REGISTERS
#undef WIDE
#undef BLOCK_WIDE
#undef ROWS
#undef LOGARITHMS
