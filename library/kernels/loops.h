/* The loops behind `compiled.c`, written once and compiled for each kind of processor.
 *
 * Whoever includes this says KIND(name), the name under which a function is compiled; LOOP, what is said of every
 * function, namely for which processor; and REGISTER, how many bytes its registers have that turn halves into floats,
 * 0 for none.
 */

#define HELPER LOOP static inline __attribute__((always_inline))

/* As many numbers as a register has, how many floats these are, and how many such may be added up side by side with four
 * products each before the registers run out. */
#if REGISTER == 0
#define BYTES 16
#else
#define BYTES REGISTER
#endif
#define FLOATS (BYTES / 4)
#define BESIDE (REGISTER == 64 ? 4 : 2)
/* As many registers as the directions of a vector fill. */
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

/* Distances of frames (frames, joints, 3) between pairs (count, 2) of joints, to rows that are `stride` apart. */
LOOP static void KIND(distances)(const double *restrict positions, Py_ssize_t frames, Py_ssize_t joints,
                                 const Py_ssize_t *restrict pairs, Py_ssize_t count, double *restrict rows,
                                 Py_ssize_t stride) {
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
}

/* Add rows at their times, with a weight, to sums (4, width): the reference, and of rows relative to it the sum, the sum
 * of products with time, and the sum of squares; and to a clock: the reference, the sum, the sum of squares. */
LOOP static void KIND(add_rows)(double *restrict sums, Py_ssize_t width, double *restrict clock,
                                const double *restrict rows, Py_ssize_t stride, const double *restrict times,
                                Py_ssize_t count, double weight) {
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

/* The index of the largest of some numbers. */
LOOP static Py_ssize_t KIND(largest)(const double *restrict numbers, Py_ssize_t count) {
    double most = numbers[0];
#pragma omp simd reduction(max : most)
    for (Py_ssize_t i = 1; i < count; i++) {
        most = numbers[i] > most ? numbers[i] : most;
    }
    Py_ssize_t place = 0;
    while (place < count - 1 && !(numbers[place] >= most)) {
        place++;
    }
    return place;
}

/* Add points relative to a reference (width), with a weight, to their sum (width) and products (width, width). */
LOOP static void KIND(add_products)(const double *restrict reference, double *restrict sum, double *restrict products,
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

HELPER double KIND(positive)(double number) { return number > 0.0 ? number : 0.0; }

/* Spread of a window of `count` rows with these sums, and posture and trend if they are wanted, all (width); gives the body's
 * size, and its movement. */
LOOP static double KIND(parts)(const double *restrict sums, Py_ssize_t width, const double *restrict clock, double count,
                              const double *restrict sizing, const Py_ssize_t *restrict segments, Py_ssize_t between,
                              const double *restrict above, Py_ssize_t joints, const uint8_t *restrict ends, double floor,
                              double level, double *restrict spread, double *restrict posture, double *restrict trend,
                              double *restrict moved_by) {
    const double *restrict reference = sums, *restrict sum = sums + width, *restrict along = sums + 2 * width;
    const double *restrict squares = sums + 3 * width;
    const double per_row = 1.0 / count, middle = clock[1] * per_row, swing = clock[2] * per_row - middle * middle;
    const double per_swing = swing > 0.0 ? 1.0 / sqrt(swing) : 0.0;
    double size = 0.0, means = 0.0, variances = 0.0, total = 0.0;
#pragma omp simd reduction(+ : size, means, variances)
    for (Py_ssize_t i = 0; i < width; i++) {
        const double offset = sum[i] * per_row, mean = reference[i] + offset;
        const double variance = KIND(positive)(squares[i] * per_row - offset * offset);
        size += mean * sizing[i];
        means += mean * mean;
        variances += variance;
        spread[i] = sqrt(variance);
    }
    /* A body in one point has no spread. */
    const double per_size = size > 0.0 ? 1.0 / size : 0.0, noise = floor * size;
    for (Py_ssize_t i = 0; trend != NULL && i < width; i++) {
        const double moved = spread[i] + noise, rising = (along[i] - sum[i] * middle) * per_row * per_swing;
        trend[i] = moved > 0.0 ? rising / moved : 0.0;
    }
    for (Py_ssize_t i = 0; i < width; i++) {
        spread[i] = spread[i] * per_size + floor;
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
    /* As many as there are bytes, so that no end is out of range. */
    double heights[MAX_JOINTS] = {0.0};
    for (Py_ssize_t s = 0; posture != NULL && s < between; s++) {
        const double length = reference[segments[s]] + sum[segments[s]] * per_row;
        for (Py_ssize_t j = 0; j < joints; j++) {
            heights[j] += length * above[s * joints + j];
        }
    }
    for (Py_ssize_t i = 0; posture != NULL && i < width; i++) {
        const double mean = reference[i] + sum[i] * per_row, down = 2 * heights[ends[2 * width + i]];
        const double length = between ? heights[ends[i]] + heights[ends[width + i]] - down : size;
        posture[i] = length > 0.0 ? mean / length : 0.0;
    }
    *moved_by = means > 0.0 ? sqrt(variances / means) : 0.0;
    return size;
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
                              double *restrict beside, double *restrict factors) {
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
        beside[c] = first > 0.0 ? -length : length;
        factors[c] = square > 0.0 ? 1.0 / (square - first * beside[c]) : 0.0;
        v[c + 1] -= beside[c];
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
    beside[size - 1] = 0.0;
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

LOOP static int KIND(eigenpairs)(const double *restrict covariance, int size, int count, double *restrict values,
                                 double *restrict vectors) {
    return KIND(pairs)(covariance, size, WIDE, count, values, vectors);
}

/* Multiply a symmetric matrix (size, size) with some vectors side by side (size, BLOCK); rows of which some sums are in
 * registers at once. */
HELPER void KIND(multiply)(const double *restrict matrix, int size, double (*restrict vectors)[BLOCK],
                           double (*restrict products)[BLOCK]) {
    for (int begin = 0; begin < size; begin += ROWS) {
        const int step = begin + ROWS <= size ? size : 0;
        KIND(Doubles) sums[ROWS][BLOCK_WIDE] = {{{0.0}}};
        for (int j = 0; j < size; j++) {
            const KIND(Doubles) *restrict row = (const KIND(Doubles) *)vectors[j];
            for (int r = 0; r < ROWS; r++) {
                for (int q = 0; q < BLOCK_WIDE; q++) {
                    sums[r][q] += matrix[begin * size + r * step + j] * row[q];
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

/* Combine the vectors in a block (size, BLOCK): what each gives to each new one is in `columns`, as for a matrix product. */
HELPER void KIND(combine)(double (*restrict block)[BLOCK], int size, double (*restrict columns)[BLOCK],
                          double (*restrict combined)[BLOCK]) {
    for (int i = 0; i < size; i++) {
        KIND(Doubles) sums[BLOCK_WIDE] = {{0.0}};
        for (int j = 0; j < BLOCK; j++) {
            const KIND(Doubles) *restrict column = (const KIND(Doubles) *)columns[j];
            for (int q = 0; q < BLOCK_WIDE; q++) {
                sums[q] += block[i][j] * column[q];
            }
        }
        memcpy(combined[i], sums, sizeof sums);
    }
}

/* Make a block (size, BLOCK) orthonormal, to `vectors`, by the Cholesky factor of its inner products; 0 where the vectors are
 * dependent. */
HELPER int KIND(orthonormal)(double (*restrict block)[BLOCK], int size, double (*restrict vectors)[BLOCK]) {
    double products[BLOCK][BLOCK], inverse[BLOCK][BLOCK] = {{0.0}};
    KIND(products)(block, block, size, products);
    for (int k = 0; k < BLOCK; k++) {
        inverse[k][k] = 1.0;
    }
    /* Elimination turns the products into the factor, and what was 1 into its inverse. */
    for (int k = 0; k < BLOCK; k++) {
        if (!(products[k][k] > 0.0)) {
            return 0;
        }
        const double factor = 1.0 / sqrt(products[k][k]);
        for (int i = 0; i < BLOCK; i++) {
            products[k][i] *= factor;
            inverse[k][i] *= factor;
        }
        for (int m = k + 1; m < BLOCK; m++) {
            const double along = products[k][m];
            for (int i = 0; i < BLOCK; i++) {
                products[m][i] -= along * products[k][i];
                inverse[m][i] -= along * inverse[k][i];
            }
        }
    }
    double columns[BLOCK][BLOCK];
    for (int k = 0; k < BLOCK; k++) {
        for (int i = 0; i < BLOCK; i++) {
            columns[i][k] = inverse[k][i];
        }
    }
    KIND(combine)(block, size, columns, vectors);
    return 1;
}

/* The largest eigenvalues of a covariance and their eigenvectors, as `eigenpairs` finds them, from a block (size, BLOCK) that
 * held those of a covariance much like it: subspace iteration (Rutishauser 1969). 0 where this does not find them: the
 * residuals stay large, or the trace leaves room for a larger eigenvalue beside them. */
HELPER int KIND(iterate)(const double *restrict covariance, int size, double trace, double *restrict values,
                         double *restrict vectors, double (*restrict block)[BLOCK]) {
    double now[MAX_DIRECTIONS][BLOCK], next[MAX_DIRECTIONS][BLOCK], inside[BLOCK][BLOCK], few[EIGENVECTORS][BLOCK];
    double columns[BLOCK][BLOCK] = {{0.0}}, found[MAX_DIRECTIONS][BLOCK], images[MAX_DIRECTIONS][BLOCK];
    memcpy(now, block, sizeof(double) * (size_t)(size * BLOCK));
    for (int turn = 1; turn <= MAX_ITERATIONS; turn++) {
        KIND(multiply)(covariance, size, now, next);
        if (turn == ITERATIONS || turn == MAX_ITERATIONS) {
            KIND(products)(now, next, size, inside);
            double left = trace, squares[BLOCK] = {0.0}, largest = 0.0;
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
            KIND(combine)(now, size, columns, found);
            KIND(combine)(next, size, columns, images);
            for (int i = 0; i < size; i++) {
                for (int k = 0; k < EIGENVECTORS; k++) {
                    const double residual = images[i][k] - values[k] * found[i][k];
                    squares[k] += residual * residual;
                    vectors[k * size + i] = found[i][k];
                }
            }
            for (int k = 0; k < EIGENVECTORS; k++) {
                largest = squares[k] > largest ? squares[k] : largest;
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

/* The largest eigenvalues of a covariance and their eigenvectors, again and again: a block (size, BLOCK), at first 0, takes
 * what is found over to the next time. */
LOOP static int KIND(eigenpairs_again)(const double *restrict covariance, int size, int count, double trace,
                                       double *restrict values, double *restrict vectors,
                                       double (*restrict block)[BLOCK]) {
    if (size < 2 * BLOCK || count < EIGENVECTORS || !(trace > 0.0)) {
        return KIND(eigenpairs)(covariance, size, count, values, vectors);
    }
    if (KIND(iterate)(covariance, size, trace, values, vectors, block)) {
        return 1;
    }
    if (!KIND(eigenpairs)(covariance, size, count, values, vectors)) {
        return 0;
    }
    /* The other vectors of a new block may be any. */
    for (int i = 0; i < size; i++) {
        for (int b = 0; b < BLOCK; b++) {
            block[i][b] = b < EIGENVECTORS ? vectors[b * size + i] : i == b ? 1.0 : 0.0;
        }
    }
    return 1;
}

/* Covariance of `count` points with these sums and products, to covariance (size, size); gives its trace. Nothing of it is
 * left where there is hardly any. */
LOOP static double KIND(covariance)(const double *restrict sum, const double *restrict products, int size, double count,
                                    double none, double *restrict covariance) {
    const double each = 1.0 / count;
    double trace = 0.0;
    for (int i = 0; i < size; i++) {
        for (int j = 0; j < size; j++) {
            covariance[i * size + j] = products[i * size + j] * each - sum[i] * each * (sum[j] * each);
        }
        trace += covariance[i * size + i];
    }
    if (trace <= none) {
        memset(covariance, 0, sizeof(double) * (size_t)(size * size));
        return 0.0;
    }
    return trace;
}

/* Add a factor times a lane of halves to sums. */
HELPER void KIND(add)(const Half *restrict lane, float factor, KIND(Floats) *restrict sums) {
    for (int j = 0; j < LANE / FLOATS; j++) {
        sums[j] += factor * KIND(widen)(lane + FLOATS * j);
    }
}

/* Place numbers by a metric: (numbers − origin) axes, to a vector (axes). The numbers are overwritten. */
HELPER void KIND(place)(const Metric *metric, float *restrict numbers, float *restrict vector) {
    for (Py_ssize_t i = 0; i < metric->numbers; i++) {
        numbers[i] -= metric->origin[i];
    }
    for (Py_ssize_t begin = 0; begin < metric->stride; begin += LANE) {
        KIND(Floats) sums[LANE / FLOATS] = {{0.0F}};
        for (Py_ssize_t i = 0; i < metric->numbers; i++) {
            KIND(add)(metric->axes + i * metric->stride + begin, numbers[i], sums);
        }
        const Py_ssize_t some = metric->kept - begin < LANE ? metric->kept - begin : LANE;
        memcpy(vector + begin, sums, sizeof(float) * (size_t)some);
    }
}

/* Write the matrix Σᵢ sᵢ sᵢᵀ of scaled eigenvectors (count, size) as a vector (size (size + 1) / 2). */
HELPER void KIND(flatten)(const double *restrict scaled, Py_ssize_t count, Py_ssize_t size, float *restrict vector) {
    for (Py_ssize_t i = 0; i < size; i++) {
        for (Py_ssize_t j = i; j < size; j++) {
            vector[j - i] = 0.0F;
        }
        for (Py_ssize_t k = 0; k < count; k++) {
            const double *restrict row = scaled + k * size;
            const float one = (float)(row[i] * sqrt(2.0));
            for (Py_ssize_t j = i; j < size; j++) {
                vector[j - i] += one * (float)row[j];
            }
        }
        vector[0] *= (float)sqrt(0.5);
        vector += size - i;
    }
}

/* Squared distances of one lane of windows to a vector, given times −2, and a little more. */
HELPER void KIND(distances_to)(const Group *group, Py_ssize_t lane, const float *restrict vector, float square,
                               float *restrict squared) {
    const Half *windows = group->windows + lane * group->axes * LANE;
    const float *lengths = group->lengths + lane * LANE;
    KIND(Floats) sums[LANE / FLOATS];
    for (int j = 0; j < LANE / FLOATS; j++) {
        sums[j] = *(const KIND(Floats) *)(lengths + FLOATS * j) + square;
    }
    for (Py_ssize_t k = 0; k < group->axes; k++) {
        KIND(add)(windows + k * LANE, vector[k], sums);
    }
    memcpy(squared, sums, sizeof sums);
}

/* The same of scaled eigenvectors (EIGENVECTORS, axes), whose matrix is of length 1: 1 + 1 − 2 Σᵢⱼ ⟨sᵢ, tⱼ⟩². */
HELPER void KIND(distances_between)(const Group *group, Py_ssize_t lane, const float *restrict scaled,
                                    float *restrict squared) {
    for (int begin = 0; begin < LANE / FLOATS; begin += BESIDE) {
        const Half *windows = group->windows + lane * EIGENVECTORS * group->axes * LANE + FLOATS * begin;
        KIND(Floats) squares[BESIDE] = {{0.0F}};
        for (int i = 0; i < EIGENVECTORS; i++) {
            KIND(Floats) products[EIGENVECTORS][BESIDE] = {{{0.0F}}};
            for (Py_ssize_t k = 0; k < group->axes; k++, windows += LANE) {
                for (int j = 0; j < BESIDE; j++) {
                    const KIND(Floats) window = KIND(widen)(windows + FLOATS * j);
                    for (int q = 0; q < EIGENVECTORS; q++) {
                        products[q][j] += scaled[q * group->axes + k] * window;
                    }
                }
            }
            for (int q = 0; q < EIGENVECTORS; q++) {
                for (int j = 0; j < BESIDE; j++) {
                    squares[j] += products[q][j] * products[q][j];
                }
            }
        }
        for (int j = 0; j < BESIDE; j++) {
            const Py_ssize_t place = lane * LANE + FLOATS * (begin + j);
            const KIND(Floats) lengths = *(const KIND(Floats) *)(group->lengths + place);
            *(KIND(Floats) *)(squared + FLOATS * (begin + j)) = 1.0F + lengths - 2.0F * squares[j];
        }
    }
}

/* The smaller of two, number by number. */
HELPER KIND(Floats) KIND(smaller)(KIND(Floats) one, KIND(Floats) other) {
    const KIND(Ints) below = one < other;
    return (KIND(Floats))(((KIND(Ints))one & below) | ((KIND(Ints))other & ~below));
}

/* The least of numbers from `begin` to before `end`, at least one; as many as a register has may be read beyond. */
HELPER float KIND(least)(const float *restrict numbers, Py_ssize_t begin, Py_ssize_t end) {
    KIND(Ints) places;
    for (int i = 0; i < FLOATS; i++) {
        places[i] = i;
    }
    const KIND(Floats) none = {0.0F}, infinite = none + INFINITY;
    KIND(Floats) least = infinite;
    for (; begin < end; begin += FLOATS) {
        const KIND(Ints) inside = places < (int32_t)(end - begin);
        const KIND(Ints) some = *(const KIND(Ints) *)(numbers + begin);
        least = KIND(smaller)((KIND(Floats))((some & inside) | ((KIND(Ints))infinite & ~inside)), least);
    }
    float smallest = INFINITY;
#pragma omp simd reduction(min : smallest)
    for (int i = 0; i < FLOATS; i++) {
        smallest = least[i] < smallest ? least[i] : smallest;
    }
    return smallest;
}

/* For each view and class the mean of the two least numbers that different people's windows have in it. */
HELPER void KIND(agree)(const Table *table, double *restrict agreed) {
    for (Py_ssize_t v = 0; v < table->views; v++) {
        const float *restrict numbers = table->products + v * table->lanes * LANE;
        for (Py_ssize_t c = 0; c < table->classes; c++) {
            const Py_ssize_t begin = table->class_starts[c], end = table->class_starts[c + 1];
            float first = INFINITY, second = INFINITY;
            for (Py_ssize_t b = begin; b < end; b++) {
                const float least = KIND(least)(numbers, table->block_starts[b], table->block_starts[b + 1]);
                const float larger = least < first ? first : least;
                second = larger < second ? larger : second;
                first = least < first ? least : first;
            }
            agreed[v * table->classes + c] = ((double)first + (double)(end - begin < 2 ? first : second)) / 2.0;
        }
    }
}

/* Write a part's numbers in the form of its metric to `room`. */
HELPER void KIND(prepare)(const Part *part, const double *restrict numbers, float *restrict room) {
    if (part->directions > 0) {
        KIND(flatten)(numbers, part->vectors, part->directions, room);
        return;
    }
    for (Py_ssize_t i = 0; i < part->metric.numbers; i++) {
        room[i] = (float)numbers[i];
    }
}

/* Compare a live window's parts with a table's windows, to logs (views, classes). */
LOOP static void KIND(compare)(const Table *table, const double *const *numbers, double *restrict logs) {
    float vectors[MAX_PARTS][MAX_AXES], squares[MAX_PARTS] = {0.0F};
    float(*placed)[MAX_AXES] = table->placed;
    for (int p = 0; p < table->parts; p++) {
        if (table->part[p].metric.kept > 0) {
            KIND(prepare)(&table->part[p], numbers[p], table->room);
            KIND(place)(&table->part[p].metric, table->room, placed[p]);
        }
    }
    for (int g = 0; g < table->groups; g++) {
        const Group *group = &table->group[g];
        const Part *first = &table->part[group->members[0]];
        Py_ssize_t end = 0;
        if (group->between) {
            memset(vectors[g], 0, sizeof vectors[g]);
            for (Py_ssize_t i = 0; i < first->vectors * first->directions; i++) {
                vectors[g][i] = (float)numbers[group->members[0]][i];
            }
            continue;
        }
        float *restrict joined = group->joint.kept > 0 ? table->room : vectors[g];
        for (int m = 0; m < group->count; m++) {
            const Py_ssize_t kept = table->part[group->members[m]].metric.kept;
            memcpy(joined + end, placed[group->members[m]], sizeof(float) * (size_t)kept);
            end += kept;
        }
        if (group->joint.kept > 0) {
            KIND(place)(&group->joint, joined, vectors[g]);
        }
        /* |a − b|² = |a|² − 2 a b + |b|². */
        for (Py_ssize_t i = 0; i < group->axes; i++) {
            squares[g] += vectors[g][i] * vectors[g][i];
            vectors[g][i] *= -2.0F;
        }
    }
    for (Py_ssize_t lane = 0; lane < table->lanes; lane++) {
        KIND(Floats) views[MAX_VIEWS][LANE / FLOATS] = {{{0.0F}}};
        float squared[LANE];
        for (int g = 0; g < table->groups; g++) {
            const Group *group = &table->group[g];
            if (group->between) {
                KIND(distances_between)(group, lane, vectors[g], squared);
            } else {
                KIND(distances_to)(group, lane, vectors[g], squares[g], squared);
            }
            /* NaN counts as the farthest. */
            for (int w = 0; w < LANE; w++) {
                const float one = squared[w] < FARTHEST ? squared[w] : FARTHEST;
                squared[w] = one > table->nearest ? one : table->nearest;
            }
            for (int j = 0; j < LANE / FLOATS; j++) {
                const KIND(Floats) logs_of = KIND(float_logs)(*(KIND(Floats) *)(squared + FLOATS * j));
                for (int v = 0; v < table->views; v++) {
                    views[v][j] += table->weights[v][g] * logs_of;
                }
            }
        }
        for (int v = 0; v < table->views; v++) {
            memcpy(table->products + (v * table->lanes + lane) * LANE, views[v], sizeof views[v]);
        }
    }
    KIND(agree)(table, logs);
}

/* Each class's best |inner product| of its windows' leading eigenvectors with another, to scores (classes). */
LOOP static void KIND(scores)(const Table *table, const double *restrict eigenvector, double *restrict scores) {
    float *restrict products = table->products;
    for (Py_ssize_t lane = 0; lane < table->lanes; lane++) {
        const float *restrict windows = table->eigenvectors + lane * table->directions * LANE;
        float sums[LANE] = {0.0F};
        for (Py_ssize_t k = 0; k < table->directions; k++) {
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
    for (Py_ssize_t c = 0; c < table->classes; c++) {
        const Py_ssize_t *starts = table->block_starts;
        scores[c] = -(double)KIND(least)(products, starts[table->class_starts[c]], starts[table->class_starts[c + 1]]);
    }
}

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
    series = series * r + 1.0F / 720.0F;
    series = series * r + 1.0F / 120.0F;
    series = series * r + 1.0F / 24.0F;
    series = series * r + 1.0F / 6.0F;
    series = series * r + 0.5F;
    series = series * r + 1.0F;
    series = series * r + 1.0F;
    power.bits = (n + 127) << 23;
    return series * power.whole;
}

/* Move the probability of every moment on by one step, to `after`. */
LOOP static void KIND(go_on)(const Course *course, const double *restrict before, double *restrict after) {
    const Py_ssize_t count = course->count;
    const double stay = course->stay, one = course->one, two = course->two;
    double mass[MAX_BINS] = {0.0}, beyond = 0.0;
    for (Py_ssize_t r = 0; r < course->recordings; r++) {
        const Py_ssize_t begin = course->starts[r], end = r + 1 < course->recordings ? course->starts[r + 1] : count;
        const Py_ssize_t last = end - 1;
        after[begin] = stay * before[begin];
        if (last > begin) {
            after[begin + 1] = stay * before[begin + 1] + one * before[begin];
        }
        for (Py_ssize_t i = begin + 2; i < end; i++) {
            after[i] = stay * before[i] + one * before[i - 1] + two * before[i - 2];
        }
        const double over = (one + two) * before[last] + (last > begin ? two * before[last - 1] : 0.0);
        after[last] += over * (1.0 - course->again);
        beyond += over;
    }
    beyond *= course->again;
    for (Py_ssize_t i = 0; i < count; i++) {
        after[i] += beyond * course->rounds[i];
        mass[course->bins[i]] += after[i];
    }
    const double keeps = 1.0 - course->changes - course->begins;
    for (Py_ssize_t i = 0; i < count; i++) {
        after[i] = keeps * after[i] + course->changes * course->alike[i] * mass[course->bins[i]] +
                   course->begins * course->beginning[i];
    }
}

/* Weigh every moment by how alike the live one is; gives what the probabilities add up to. `room` has room for as many
 * floats as there are moments, and a register more. */
LOOP static double KIND(weigh)(const Course *course, const float *restrict live, double *restrict belief,
                               float *restrict room) {
    const Py_ssize_t count = course->count;
    memcpy(room, course->lengths, sizeof(float) * (size_t)count);
    for (Py_ssize_t k = 0; k < course->axes; k++) {
        const float *restrict axis = course->vectors + k * count;
        const float factor = -2.0F * live[k];
        for (Py_ssize_t i = 0; i < count; i++) {
            room[i] += factor * axis[i];
        }
    }
    float least = INFINITY;
#pragma omp simd reduction(min : least)
    for (Py_ssize_t i = 0; i < count; i++) {
        least = room[i] < least ? room[i] : least;
    }
    const float sharpness = -0.5F * (float)course->sharpness;
    for (Py_ssize_t i = 0; i < count; i += FLOATS) {
        KIND(Floats) *some = (KIND(Floats) *)(room + i);
        *some = KIND(float_exps)(sharpness * (*some - least));
    }
    double total = 0.0;
#pragma omp simd reduction(+ : total)
    for (Py_ssize_t i = 0; i < count; i++) {
        belief[i] *= (double)room[i];
        total += belief[i];
    }
    return total;
}

/* Take one step of the filter; what is told: the phase at which half the probability lies below, the probability near it,
 * and the mean of each of some rows of numbers. */
LOOP static void KIND(follow_phase)(const Course *course, const float *restrict live, double *restrict belief,
                                    double *restrict after, float *restrict room, double *restrict told) {
    const Py_ssize_t count = course->count;
    KIND(go_on)(course, belief, after);
    const double total = KIND(weigh)(course, live, after, room);
    const double factor = total > 0.0 ? 1.0 / total : 0.0;
    for (Py_ssize_t i = 0; i < count; i++) {
        belief[i] = total > 0.0 ? after[i] * factor : course->beginning[i];
    }
    double below = 0.0, near = 0.0;
    Py_ssize_t place = 0;
    for (; place < count - 1; place++) {
        below += belief[course->order[place]];
        if (below >= 0.5) {
            break;
        }
    }
    const double phase = course->phases[course->order[place]], far = course->near;
#pragma omp simd reduction(+ : near)
    for (Py_ssize_t i = 0; i < count; i++) {
        near += fabs(course->phases[i] - phase) <= far ? belief[i] : 0.0;
    }
    told[0] = phase;
    told[1] = near;
    for (Py_ssize_t row = 0; row < course->rows; row++) {
        const double *restrict numbers = course->expected + row * count;
        double mean = 0.0;
#pragma omp simd reduction(+ : mean)
        for (Py_ssize_t i = 0; i < count; i++) {
            mean += belief[i] * numbers[i];
        }
        told[2 + row] = mean;
    }
}

/* Where a body is and how it moves, whitened, to `live` (width); the squared length of the velocity, `back` points long and
 * times a factor; and the summed variance of points (count, directions). */
LOOP static void KIND(moving)(const double *restrict points, Py_ssize_t count, Py_ssize_t stride, Py_ssize_t directions,
                              Py_ssize_t back, double factor, const double *restrict whitening, Py_ssize_t width,
                              float *restrict live, double *restrict square, double *restrict variance) {
    const double *restrict now = points + (count - 1) * stride, *restrict before = now - back * stride;
    double vector[2 * MAX_DIRECTIONS], mean[MAX_DIRECTIONS] = {0.0}, squares[MAX_DIRECTIONS] = {0.0};
    *square = *variance = 0.0;
    for (Py_ssize_t d = 0; d < directions; d++) {
        const double velocity = factor * (now[d] - before[d]);
        vector[d] = now[d];
        vector[directions + d] = velocity;
        *square += velocity * velocity;
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
        *variance += squares[d] / (double)count;
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
}

/* The steps of a body's joints (frames, joints, 3) from frame to frame, the first from `last` (joints, 3); give the largest
 * sum of squares of a frame's steps about their mean, NaN if there is one. */
LOOP static double KIND(steps)(const double *restrict positions, Py_ssize_t frames, Py_ssize_t joints,
                               const double *restrict last, double *restrict steps) {
    double largest = 0.0;
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
        double about_mean = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            about_mean += squares[axis] - sums[axis] * sums[axis] / (double)joints;
        }
        largest = about_mean > largest || about_mean != about_mean ? about_mean : largest;
    }
    return largest;
}

/* Of segments between joints (segments, 2), in some frames (frames, joints, 3): the mean of the least and greatest length,
 * and how far they are apart, (2, segments); and how far each joint moves along an axis at most, (joints). NaN counts only
 * where there is nothing else. */
LOOP static void KIND(extremes)(const double *restrict positions, Py_ssize_t frames, Py_ssize_t joints,
                                const Py_ssize_t *restrict ends, Py_ssize_t segments, double *restrict lengths,
                                double *restrict moved) {
    for (Py_ssize_t s = 0; s < segments; s++) {
        double least = (double)NAN, greatest = (double)NAN;
        for (Py_ssize_t f = 0; f < frames; f++) {
            const double *one = positions + 3 * (f * joints + ends[2 * s]);
            const double *other = positions + 3 * (f * joints + ends[2 * s + 1]);
            const double x = one[0] - other[0], y = one[1] - other[1], z = one[2] - other[2];
            const double length = sqrt(x * x + y * y + z * z);
            least = length < least || least != least ? length : least;
            greatest = length > greatest || greatest != greatest ? length : greatest;
        }
        lengths[s] = (least + greatest) / 2;
        lengths[segments + s] = greatest - least;
    }
    for (Py_ssize_t j = 0; j < joints; j++) {
        double most = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            double near = (double)NAN, far = (double)NAN;
            for (Py_ssize_t f = 0; f < frames; f++) {
                const double place = positions[3 * (f * joints + j) + axis];
                near = place < near || near != near ? place : near;
                far = place > far || far != far ? place : far;
            }
            most = far - near > most || far != far ? far - near : most;
        }
        moved[j] = most;
    }
}

#undef HELPER
#undef BYTES
#undef FLOATS
#undef BESIDE
#undef WIDE
#undef BLOCK_WIDE
#undef ROWS
#undef LOGARITHMS
