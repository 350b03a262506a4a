/* The loops behind `compiled.c`, written once and compiled for each kind of processor.
 *
 * Whoever includes this says KIND(name), the name under which a function is compiled; LOOP, what is said of every
 * function, namely for which processor; and REGISTER, how many bytes its registers have that turn halves into floats,
 * 0 for none.
 */

#define HELPER LOOP static inline __attribute__((always_inline))

/* Make floats of sixteen halves. */
HELPER void KIND(widen)(const Half *restrict halves, Floats *restrict floats) {
#if REGISTER == 64
    *floats = (Floats)_mm512_cvtph_ps(_mm256_loadu_si256((const __m256i *)halves));
#elif REGISTER == 32
    union {
        __m256 parts[2];
        Floats whole;
    } both;
    both.parts[0] = _mm256_cvtph_ps(_mm_loadu_si128((const __m128i *)halves));
    both.parts[1] = _mm256_cvtph_ps(_mm_loadu_si128((const __m128i *)halves + 1));
    *floats = both.whole;
#else
    /* Sign, exponent and digits go to where a float has them; what the exponents are apart is made up for. */
    union {
        uint32_t bits[16];
        Floats whole;
    } all;
    for (int i = 0; i < 16; i++) {
        all.bits[i] = (uint32_t)(halves[i] & 0x7FFF) << 13 | (uint32_t)(halves[i] & 0x8000) << 16;
    }
    *floats = all.whole * 0x1p112F;
#endif
}

/* Distances of frames (frames, joints, 3) between pairs (count, 2) of joints, to rows that are `stride` apart. */
LOOP static void KIND(distances)(const double *restrict positions, Py_ssize_t frames, Py_ssize_t joints,
                                 const Py_ssize_t *restrict pairs, Py_ssize_t count, double *restrict rows,
                                 Py_ssize_t stride) {
    double places[MOST_JOINTS][3][TOGETHER];
    for (Py_ssize_t begin = 0; begin < frames; begin += TOGETHER) {
        Py_ssize_t some = frames - begin < TOGETHER ? frames - begin : TOGETHER;
        for (Py_ssize_t j = 0; j < joints; j++) {
            for (int axis = 0; axis < 3; axis++) {
                for (Py_ssize_t k = 0; k < TOGETHER; k++) {
                    /* Where frames are lacking the first stands in; nobody asks for what comes of it. */
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

/* Add rows, times a weight, to sums (3, width): what they are relative to, the sum, and the sum of squares. */
LOOP static void KIND(add_rows)(double *restrict sums, Py_ssize_t width, const double *restrict rows, Py_ssize_t stride,
                                Py_ssize_t count, double weight) {
    const double *restrict reference = sums;
    double *restrict sum = sums + width, *restrict squares = sums + 2 * width;
    for (Py_ssize_t row = 0; row < count; row++) {
        const double *restrict numbers = rows + row * stride;
        for (Py_ssize_t i = 0; i < width; i++) {
            double difference = numbers[i] - reference[i];
            sum[i] += weight * difference;
            squares[i] += weight * difference * difference;
        }
    }
}

/* Spread of a window of `count` rows with these sums, to numbers (width); gives its movement. */
LOOP static double KIND(spread)(const double *restrict sums, Py_ssize_t width, double count,
                                const double *restrict sizing, double floor, double level, double *restrict numbers) {
    const double *restrict reference = sums, *restrict sum = sums + width, *restrict squares = sums + 2 * width;
    const double per_row = 1.0 / count, per_degree = 1.0 / (count > 1.0 ? count - 1.0 : 1.0);
    double size = 0.0, means = 0.0, variances = 0.0;
#pragma omp simd reduction(+ : size, means, variances)
    for (Py_ssize_t i = 0; i < width; i++) {
        double mean = reference[i] + sum[i] * per_row;
        double scatter = squares[i] - sum[i] * sum[i] * per_row;
        double variance = (scatter > 0.0 ? scatter : 0.0) * per_degree;
        size += mean * sizing[i];
        means += mean * mean;
        variances += variance;
        numbers[i] = variance;
    }
    /* All joints in one point do not swing. */
    const double per_size = size > 0.0 ? 1.0 / size : 0.0;
    for (Py_ssize_t i = 0; i < width; i++) {
        numbers[i] = sqrt(numbers[i]) * per_size + floor;
    }
    double logs = 0.0;
    for (Py_ssize_t i = 0; i < width; i++) {
        numbers[i] = log(numbers[i]);
        logs += numbers[i];
    }
    const double removed = level * logs / (double)width;
    for (Py_ssize_t i = 0; i < width; i++) {
        numbers[i] -= removed;
    }
    return means > 0.0 ? sqrt(variances / means) : 0.0;
}

/* Add the products of one band of directions with all up to it, `wide` times eight of them, over some centred frames. */
HELPER void KIND(add_products)(const double (*restrict centred)[MOST_DIRECTIONS], Py_ssize_t frames, int band,
                               const int wide, double (*restrict covariance)[MOST_DIRECTIONS]) {
    Doubles sum[BAND][MOST_DIRECTIONS / 8];
    for (int i = 0; i < BAND; i++) {
        for (int j = 0; j < wide; j++) {
            sum[i][j] = *(const Doubles *)&covariance[band + i][8 * j];
        }
    }
    for (Py_ssize_t t = 0; t < frames; t++) {
        for (int j = 0; j < wide; j++) {
            const Doubles others = *(const Doubles *)&centred[t][8 * j];
            for (int i = 0; i < BAND; i++) {
                sum[i][j] += centred[t][band + i] * others;
            }
        }
    }
    for (int i = 0; i < BAND; i++) {
        for (int j = 0; j < wide; j++) {
            *(Doubles *)&covariance[band + i][8 * j] = sum[i][j];
        }
    }
}

/* Add up the products of courses (frames, size) about their mean, lower triangle; gives the mean's squared length. */
HELPER double KIND(scatter)(const double *restrict courses, Py_ssize_t stride, Py_ssize_t frames, int size,
                            double (*restrict scatter)[MOST_DIRECTIONS]) {
    double mean[MOST_DIRECTIONS] = {0.0}, centred[SOME_FRAMES][MOST_DIRECTIONS] = {{0.0}}, square = 0.0;
    for (Py_ssize_t t = 0; t < frames; t++) {
        for (int i = 0; i < size; i++) {
            mean[i] += courses[t * stride + i];
        }
    }
    for (int i = 0; i < size; i++) {
        mean[i] /= (double)frames;
        square += mean[i] * mean[i];
    }
    for (Py_ssize_t begin = 0; begin < frames; begin += SOME_FRAMES) {
        Py_ssize_t some = frames - begin < SOME_FRAMES ? frames - begin : SOME_FRAMES;
        for (Py_ssize_t t = 0; t < some; t++) {
            for (int i = 0; i < size; i++) {
                centred[t][i] = courses[(begin + t) * stride + i] - mean[i];
            }
        }
        /* Written out: how wide a band is must be known for its sums to stay in registers. */
        for (int band = 0; band < size; band += BAND) {
            switch (band / 8) {
            case 0: KIND(add_products)(centred, some, band, 1, scatter); break;
            case 1: KIND(add_products)(centred, some, band, 2, scatter); break;
            case 2: KIND(add_products)(centred, some, band, 3, scatter); break;
            default: KIND(add_products)(centred, some, band, 4, scatter); break;
            }
        }
    }
    return square;
}

/* Take the lower Cholesky factor in place, column by column: each takes what it says out of all right of it. */
HELPER void KIND(cholesky)(double (*restrict c)[MOST_DIRECTIONS], int size) {
    for (int k = 0; k < size; k++) {
        double column[MOST_DIRECTIONS];
        const double per_pivot = 1.0 / sqrt(c[k][k]);
        for (int i = k; i < size; i++) {
            column[i] = c[i][k] *= per_pivot;
        }
        for (int i = k + 1; i < size; i++) {
            const double one = column[i];
            for (int j = k + 1; j <= i; j++) {
                c[i][j] -= one * column[j];
            }
        }
    }
}

/* Shape of a covariance, lower triangle, that is overwritten, to numbers (size (size + 1) / 2). */
HELPER void KIND(shape_of)(double (*restrict c)[MOST_DIRECTIONS], int size, double no_trace, double floor,
                           double *restrict numbers) {
    double trace = 0.0;
    for (int i = 0; i < size; i++) {
        trace += c[i][i];
    }
    if (trace <= no_trace) {
        memset(numbers, 0, sizeof(double) * (size_t)(size * (size + 1) / 2));
        return;
    }
    for (int i = 0; i < size; i++) {
        for (int j = 0; j < i; j++) {
            c[i][j] /= trace;
        }
        c[i][i] = c[i][i] / trace + floor;
    }
    KIND(cholesky)(c, size);
    for (int i = 0; i < size; i++) {
        for (int j = 0; j <= i; j++) {
            *numbers++ = c[i][j];
        }
    }
}

/* Shape of a window of courses (frames, size). */
LOOP static void KIND(shape)(const double *restrict courses, Py_ssize_t stride, Py_ssize_t frames, int size,
                             double floor, double no_movement, double *restrict numbers) {
    double c[MOST_DIRECTIONS][MOST_DIRECTIONS] = {{0.0}};
    const double square = KIND(scatter)(courses, stride, frames, size, c);
    const double no_trace = (double)(frames > 1 ? frames - 1 : 1) * square * no_movement * no_movement;
    KIND(shape_of)(c, size, no_trace, floor, numbers);
}

/* The shape of what has this shape, but in other directions (size, fewer). */
LOOP static void KIND(turned)(const double *restrict shape, int size, const double *restrict directions, int fewer,
                              double floor, double *restrict numbers) {
    double factor[MOST_DIRECTIONS][MOST_DIRECTIONS] = {{0.0}}, c[MOST_DIRECTIONS][MOST_DIRECTIONS] = {{0.0}};
    /* Dᵀ L Lᵀ D is Dᵀ L times its transpose. */
    for (int i = 0; i < size; i++) {
        for (int k = 0; k <= i; k++) {
            const double one = *shape++;
            for (int j = 0; j < fewer; j++) {
                factor[k][j] += one * directions[i * fewer + j];
            }
        }
    }
    for (int k = 0; k < size; k++) {
        for (int i = 0; i < fewer; i++) {
            for (int j = 0; j <= i; j++) {
                c[i][j] += factor[k][i] * factor[k][j];
            }
        }
    }
    KIND(shape_of)(c, fewer, 0.0, floor, numbers);
}

/* Place a measure: its part of the vector, and its squared distance from the origin. */
HELPER float KIND(place)(const Part *part, const double *restrict measure, float *restrict difference,
                         float *restrict vector) {
    float square = 0.0F, outside = 0.0F;
    for (Py_ssize_t i = 0; i < part->numbers; i++) {
        difference[i] = (float)(measure[i] - (double)part->origin[i]);
    }
    for (Py_ssize_t begin = 0; begin < part->stride; begin += SOME_AXES) {
        const Half *directions = part->directions + begin;
        Floats sum[SOME_AXES / 16] = {{0.0F}}, direction;
        for (Py_ssize_t i = 0; i < part->numbers; i++, directions += part->stride) {
            for (int j = 0; j < SOME_AXES / 16; j++) {
                KIND(widen)(directions + 16 * j, &direction);
                sum[j] += difference[i] * direction;
            }
        }
        for (Py_ssize_t j = begin; j < begin + SOME_AXES && j < part->axes; j++) {
            vector[j] = sum[(j - begin) / 16][(j - begin) % 16];
            square += vector[j] * vector[j];
        }
    }
    if (part->outside > 0.0F) {
#pragma omp simd reduction(+ : outside)
        for (Py_ssize_t i = 0; i < part->numbers; i++) {
            outside += difference[i] * difference[i];
        }
        outside *= part->outside;
        square = outside > square ? outside : square;
    }
    for (Py_ssize_t j = 0; j < part->axes; j++) {
        vector[j] *= part->root;
    }
    return square * part->root * part->root;
}

/* Place all measures of a group. */
HELPER void KIND(ask)(const Table *table, const Group *group, const double *const *measures, Asking *asking) {
    float *vector = asking->vector;
    asking->square = 0.0F;
    for (int p = group->begin; p < group->end; p++) {
        asking->square += KIND(place)(&table->part[p], measures[p], table->difference, vector);
        vector += table->part[p].axes;
    }
    /* Far off, it is as far from all. */
    if (!(asking->square <= table->farthest)) {
        memset(asking->vector, 0, sizeof asking->vector);
        asking->square = table->farthest;
    }
}

/* Squared distances of one lane of windows to a vector, and a little more. */
HELPER void KIND(distances_to)(const Group *group, Py_ssize_t lane, const Asking *asking, float nearest,
                               Floats *restrict squared) {
    const Floats *lengths = (const Floats *)(group->lengths + lane * LANE);
    const Half *windows = group->windows + lane * group->axes * LANE;
    Floats sum[LANE / 16], window;
    for (int j = 0; j < LANE / 16; j++) {
        sum[j] = lengths[j] + asking->square;
    }
    for (Py_ssize_t k = 0; k < group->axes; k++, windows += LANE) {
        const float twice = -2.0F * asking->vector[k];
        for (int j = 0; j < LANE / 16; j++) {
            KIND(widen)(windows + 16 * j, &window);
            sum[j] += twice * window;
        }
    }
    for (int j = 0; j < LANE / 16; j++) {
        for (int w = 0; w < 16; w++) {
            squared[j][w] = sum[j][w] > nearest ? sum[j][w] : nearest;
        }
    }
}

/* For each class the mean logarithm of the two least products that different people's windows have in it. */
HELPER void KIND(agree)(const Table *table, const float *restrict products, double *restrict logs) {
    for (Py_ssize_t c = 0; c < table->classes; c++) {
        float first = INFINITY, second = INFINITY;
        for (Py_ssize_t b = table->class_starts[c]; b < table->class_starts[c + 1]; b++) {
            float least = INFINITY;
#pragma omp simd reduction(min : least)
            for (Py_ssize_t w = table->block_starts[b]; w < table->block_starts[b + 1]; w++) {
                least = products[w] < least ? products[w] : least;
            }
            second = least < first ? first : least < second ? least : second;
            first = least < first ? least : first;
        }
        int alone = table->class_starts[c + 1] - table->class_starts[c] < 2;
        logs[c] = (log((double)first) + log((double)(alone ? first : second))) / (2.0 * table->groups);
    }
}

/* Compare a live window's measures, (numbers) for each part, with a table's windows, to logs (classes). */
LOOP static void KIND(compare)(const Table *table, const double *const *measures, double *restrict logs) {
    Asking asking[MOST_PARTS];
    for (int g = 0; g < table->groups; g++) {
        KIND(ask)(table, &table->group[g], measures, &asking[g]);
    }
    for (Py_ssize_t lane = 0; lane < table->lanes; lane++) {
        Floats *products = (Floats *)(table->products + lane * LANE), squared[LANE / 16];
        KIND(distances_to)(&table->group[0], lane, &asking[0], table->nearest, products);
        for (int g = 1; g < table->groups; g++) {
            KIND(distances_to)(&table->group[g], lane, &asking[g], table->nearest, squared);
            for (int j = 0; j < LANE / 16; j++) {
                products[j] *= squared[j];
            }
        }
    }
    KIND(agree)(table, table->products, logs);
}

/* The same, but give each group's squared distances as they are: (groups, windows). */
LOOP static void KIND(squares)(const Table *table, const double *const *measures, float *restrict squares) {
    for (int g = 0; g < table->groups; g++, squares += table->windows) {
        Asking asking;
        KIND(ask)(table, &table->group[g], measures, &asking);
        for (Py_ssize_t lane = 0; lane < table->lanes; lane++) {
            Floats squared[LANE / 16];
            KIND(distances_to)(&table->group[g], lane, &asking, table->nearest, squared);
            Py_ssize_t left = table->windows - lane * LANE;
            memcpy(squares + lane * LANE, squared, sizeof(float) * (size_t)(left < LANE ? left : LANE));
        }
    }
}

/* Inner products of an axis with all of a look's, to products (motions), and the best of each class. */
LOOP static void KIND(products)(const Look *look, const float *restrict axis, float *restrict products,
                                Py_ssize_t *restrict best) {
    const Half *within = look->within;
    for (Py_ssize_t lane = 0; lane < look->lanes; lane++) {
        Floats sum[LANE / 16] = {{0.0F}}, numbers;
        for (Py_ssize_t k = 0; k < look->directions; k++, within += LANE) {
            for (int j = 0; j < LANE / 16; j++) {
                KIND(widen)(within + 16 * j, &numbers);
                sum[j] += axis[k] * numbers;
            }
        }
        Py_ssize_t left = look->motions - lane * LANE;
        memcpy(products + lane * LANE, sum, sizeof(float) * (size_t)(left < LANE ? left : LANE));
    }
    for (Py_ssize_t c = 0; c < look->classes; c++) {
        const Py_ssize_t end = look->class_starts[c + 1];
        float most = 0.0F;
#pragma omp simd reduction(max : most)
        for (Py_ssize_t i = look->class_starts[c]; i < end; i++) {
            const float score = fabsf(products[i]);
            most = score > most ? score : most;
        }
        Py_ssize_t place = look->class_starts[c];
        while (place < end - 1 && !(fabsf(products[place]) >= most)) {
            place++;
        }
        best[c] = place;
    }
}

/* List the motions whose score may be what is the least of their class, or more; says how many they are. */
LOOP static Py_ssize_t KIND(listed)(const Look *look, const float *restrict products, const float *restrict least,
                                    float outside, Py_ssize_t *restrict listed) {
    Py_ssize_t count = 0;
    for (Py_ssize_t c = 0; c < look->classes; c++) {
        const Py_ssize_t end = look->class_starts[c + 1];
        for (Py_ssize_t begin = look->class_starts[c]; begin < end; begin += LANE) {
            const Py_ssize_t stop = begin + LANE < end ? begin + LANE : end;
            int some = 0;
            /* Most lanes have none: they are passed over without a look at each. */
#pragma omp simd reduction(| : some)
            for (Py_ssize_t i = begin; i < stop; i++) {
                some |= fabsf(products[i]) + look->outside[i] * outside + look->doubt[i] >= least[c];
            }
            for (Py_ssize_t i = begin; some && i < stop; i++) {
                listed[count] = i;
                count += fabsf(products[i]) + look->outside[i] * outside + look->doubt[i] >= least[c];
            }
        }
    }
    return count;
}

/* Add to sums the products of a vector (width) with the rows that are listed. */
LOOP static void KIND(add_products_of)(const float *restrict rows, Py_ssize_t stride, Py_ssize_t width,
                                       const float *restrict vector, const Py_ssize_t *restrict listed,
                                       Py_ssize_t count, float *restrict sums) {
    for (Py_ssize_t i = 0; i < count; i++) {
        if (i + AHEAD < count) {
            /* Rows lie anywhere: who waits for each when it is needed waits for most of the time. */
            const char *next = (const char *)(rows + listed[i + AHEAD] * stride);
            for (Py_ssize_t b = 0; b < width * (Py_ssize_t)sizeof(float); b += LINE) {
                __builtin_prefetch(next + b);
            }
        }
        const float *restrict row = rows + listed[i] * stride;
        float sum = 0.0F;
#pragma omp simd reduction(+ : sum)
        for (Py_ssize_t k = 0; k < width; k++) {
            sum += row[k] * vector[k];
        }
        sums[i] += sum;
    }
}

/* Inner product. */
HELPER double KIND(dot)(const double *restrict one, const double *restrict other, Py_ssize_t width) {
    double sum = 0.0;
#pragma omp simd reduction(+ : sum)
    for (Py_ssize_t i = 0; i < width; i++) {
        sum += one[i] * other[i];
    }
    return sum;
}

HELPER double KIND(sum)(const double *restrict numbers, Py_ssize_t count) {
    double sum = 0.0;
#pragma omp simd reduction(+ : sum)
    for (Py_ssize_t i = 0; i < count; i++) {
        sum += numbers[i];
    }
    return sum;
}

/* Inner products of the newest `fresh` of so many rows with all of them, relative to a reference, into a square; of each
 * of the fresh rows the products with itself and with the reference, to two rows `apart`. */
LOOP static void KIND(add_frames)(const double *restrict rows, Py_ssize_t stride, Py_ssize_t count, Py_ssize_t width,
                                  Py_ssize_t fresh, const double *restrict reference, double *restrict relative,
                                  double *restrict square, Py_ssize_t side, double *restrict of_each, Py_ssize_t apart) {
    const Py_ssize_t known = count - fresh;
    double along[TOGETHER];
    for (Py_ssize_t begin = known; begin < count; begin += TOGETHER) {
        const Py_ssize_t some = count - begin < TOGETHER ? count - begin : TOGETHER;
        for (Py_ssize_t k = 0; k < TOGETHER; k++) {
            /* Where rows are lacking the last stands in; nobody asks for what comes of it. */
            const double *restrict row = rows + (begin + (k < some ? k : some - 1)) * stride;
            for (Py_ssize_t i = 0; i < width; i++) {
                relative[k * width + i] = row[i] - reference[i];
            }
            along[k] = KIND(dot)(relative + k * width, reference, width);
        }
        for (Py_ssize_t other = 0; other < begin + some; other++) {
            /* Those that are at hand relative to the reference are taken so: what is near 0 keeps its digits. */
            const double *restrict row = other < begin ? rows + other * stride : relative + (other - begin) * width;
            double first = 0.0, second = 0.0, third = 0.0, fourth = 0.0;
#pragma omp simd reduction(+ : first, second, third, fourth)
            for (Py_ssize_t i = 0; i < width; i++) {
                first += relative[i] * row[i];
                second += relative[width + i] * row[i];
                third += relative[2 * width + i] * row[i];
                fourth += relative[3 * width + i] * row[i];
            }
            const double products[TOGETHER] = {first, second, third, fourth};
            for (Py_ssize_t k = 0; k < some; k++) {
                /* One of the two need not be relative: what it has too much is the same for all rows. */
                const double product = products[k] - (other < begin ? along[k] : 0.0);
                square[(begin + k) * side + other] = product;
                square[other * side + begin + k] = product;
            }
        }
        for (Py_ssize_t k = 0; k < some; k++) {
            of_each[begin + k] = square[(begin + k) * side + begin + k];
            of_each[apart + begin + k] = along[k];
        }
    }
}

/* Multiply TOGETHER vectors (size) with a symmetric matrix; their means are taken out before and after. */
LOOP static void KIND(times_centred)(const double *restrict vectors, const double *restrict square, Py_ssize_t side,
                                     Py_ssize_t size, double *restrict images) {
    Py_ssize_t begin = 0;
    double means[TOGETHER];
    for (int k = 0; k < TOGETHER; k++) {
        means[k] = KIND(sum)(vectors + k * size, size) / (double)size;
    }
    for (; begin + 16 <= size; begin += 16) {
        Doubles sum[TOGETHER][2] = {{{0.0}}};
        for (Py_ssize_t i = 0; i < size; i++) {
            const Doubles one = *(const Doubles *)(square + i * side + begin);
            const Doubles other = *(const Doubles *)(square + i * side + begin + 8);
            for (int k = 0; k < TOGETHER; k++) {
                const double number = vectors[k * size + i] - means[k];
                sum[k][0] += number * one;
                sum[k][1] += number * other;
            }
        }
        for (int k = 0; k < TOGETHER; k++) {
            *(Doubles *)(images + k * size + begin) = sum[k][0];
            *(Doubles *)(images + k * size + begin + 8) = sum[k][1];
        }
    }
    for (; begin < size; begin++) {
        /* A symmetric matrix's columns are its rows. */
        for (int k = 0; k < TOGETHER; k++) {
            images[k * size + begin] = KIND(dot)(square + begin * side, vectors + k * size, size) -
                                       means[k] * KIND(sum)(square + begin * side, size);
        }
    }
    for (int k = 0; k < TOGETHER; k++) {
        const double mean = KIND(sum)(images + k * size, size) / (double)size;
        for (Py_ssize_t i = 0; i < size; i++) {
            images[k * size + i] -= mean;
        }
    }
}

/* Make an orthonormal basis of what some vectors span; 0 if one of them hardly leaves what those before it span. */
LOOP static int KIND(orthonormal)(const double *restrict vectors, Py_ssize_t count, Py_ssize_t size,
                                  double *restrict basis) {
    memcpy(basis, vectors, sizeof(double) * (size_t)(count * size));
    for (Py_ssize_t k = 0; k < count; k++) {
        double *restrict vector = basis + k * size;
        const double before = KIND(dot)(vector, vector, size);
        double left = before;
        /* Twice is enough (Parlett, The Symmetric Eigenvalue Problem, section 6.9). */
        for (int pass = 0; pass < 2; pass++) {
            for (Py_ssize_t other = 0; other < k; other++) {
                const double *restrict beside = basis + other * size;
                const double product = KIND(dot)(beside, vector, size);
                for (Py_ssize_t i = 0; i < size; i++) {
                    vector[i] -= product * beside[i];
                }
            }
            left = KIND(dot)(vector, vector, size);
        }
        if (!(left > 1e-20 * before) || !(left < INFINITY)) {
            return 0;
        }
        const double per_length = 1.0 / sqrt(left);
        for (Py_ssize_t i = 0; i < size; i++) {
            vector[i] *= per_length;
        }
    }
    return 1;
}

#undef HELPER
