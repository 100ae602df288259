/* C limit of `radarsim.studies.plane`: an extended filter of constant velocity with Doppler over given plots, alone and
   by PDA among false ones; estimates, what it believes, NEES and all sums, eight realisations at a time.
   gcc -O3 -march=native -fno-math-errno -shared -fPIC -o plane_limit.so plane_limit.c -lm */
#include "lanes.h"
#include <string.h>

enum { N = 4, M = 3, C = 4, PACKED = 10, FIRST_FALSE = 1 + M + C, PLACE = 1 + M };
static const int AT[4][4] = {{0, 1, 2, 3}, {1, 4, 5, 6}, {2, 5, 7, 8}, {3, 6, 8, 9}};

typedef struct {
    int groups, count, scans, rows, places;
    double dt, noise, start, span, density, gate, missed, clear, sigma_r, sigma_b, sigma_v;
    const double *plots, *window;
} World;
typedef struct { double *error, *paired, *believed, *nees, *counts; } Sums;

#ifdef __AVX512F__
IN v8 root8(v8 x) { return (v8)_mm512_sqrt_pd((__m512d)x); }
IN v8 nearest8(v8 x) { return (v8)_mm512_roundscale_pd((__m512d)x, 8); }
IN int any_greater(v8 x, v8 y) { return _mm512_cmp_pd_mask((__m512d)x, (__m512d)y, _CMP_GT_OQ) != 0; }
#else
IN v8 root8(v8 x) { return root(x); }
IN v8 nearest8(v8 x) {
    v8 y;
    for (int i = 0; i < 8; i++) y[i] = rint(x[i]);
    return y;
}
IN int any_greater(v8 x, v8 y) {
    i8 m = x > y;
    int64_t any = 0;
    for (int i = 0; i < 8; i++) any |= m[i];
    return any != 0;
}
#endif
IN v8 absolute(v8 x) { return (v8)((i8)x & 0x7FFFFFFFFFFFFFFF); }
IN v8 greater(v8 x, v8 y) { return where_greater(x, y, x, y); }
IN v8 wrapped(v8 x, double turn) { return x - nearest8(x * (1 / turn)) * turn; }
IN v8 arctangent(v8 y, v8 x) {
    v8 zero = full(0), one = full(1), a = absolute(x), b = absolute(y), low = where_greater(b, a, a, b), high = greater(a, b);
    v8 edge = high * 0.41421356237309503, top = where_greater(low, edge, high - low, low);
    v8 under = where_greater(low, edge, high + low, high), t = top / where_greater(under, zero, under, one), u = t * t;
    v8 p = u * 0.021278694907295097 - 0.04360708638931716;
    p = p * u + 0.056931249673770265, p = p * u - 0.0664123876781761, p = p * u + 0.07690082512695902;
    p = p * u - 0.09090783470576942, p = p * u + 0.11111106701158656, p = p * u - 0.1428571419647109;
    p = p * u + 0.1999999999910404, p = p * u - 0.3333333333333022;
    v8 angle = t + t * u * p;
    angle = where_greater(low, edge, M_PI / 4 - angle, angle), angle = where_greater(b, a, M_PI / 2 - angle, angle);
    angle = where_greater(zero, x, M_PI - angle, angle);
    return where_greater(zero, y, -angle, angle);
}
IN v8 exponential(v8 x) { /* from -700 on */
    v8 n = nearest8(greater(x, full(-700)) * 1.4426950408889634), r = (greater(x, full(-700)) - n * 0.693147180369123816490) - n * 1.90821492927058770002e-10;
    v8 p = r * (1 / 6227020800.0) + 1 / 479001600.0;
    p = p * r + 1 / 39916800.0, p = p * r + 1 / 3628800.0, p = p * r + 1 / 362880.0, p = p * r + 1 / 40320.0;
    p = p * r + 1 / 5040.0, p = p * r + 1 / 720.0, p = p * r + 1 / 120.0, p = p * r + 1 / 24.0, p = p * r + 1 / 6.0;
    p = p * r + 0.5, p = p * r + 1.0, p = p * r + 1.0;
    return p * (v8)((__builtin_convertvector(n, i8) + 1023) << 52);
}

typedef struct { v8 r, north, east, v, along[2]; } Polar;
IN Polar polar(const v8 *x) {
    v8 r = root8(x[0] * x[0] + x[1] * x[1]), per = 1.0 / r, n = x[0] * per, e = x[1] * per, v = n * x[2] + e * x[3];
    return (Polar){r, n, e, v, {(x[2] - v * n) * per, (x[3] - v * e) * per}};
}

/* ---- the filter ---- */
IN void begin(const World *w, const v8 *z, v8 *x, v8 *P) {
    v8 half = wrapped(z[1], 2 * M_PI), s, o; /* sine and cosine by the library: once a track */
    for (int i = 0; i < 8; i++) s[i] = sin(half[i]), o[i] = cos(half[i]);
    int known = 100 * w->start * w->start < w->span * w->span; /* the fold of the first velocity */
    double a = w->sigma_r * w->sigma_r, ss = w->start * w->start, vv = known ? w->sigma_v * w->sigma_v : ss;
    v8 v = known ? z[2] : full(0), across = z[0] * w->sigma_b, d = across * across;
    x[0] = z[0] * o, x[1] = z[0] * s, x[2] = v * o, x[3] = v * s;
    P[0] = a * o * o + d * s * s, P[1] = (a - d) * s * o, P[4] = a * s * s + d * o * o;
    P[7] = vv * o * o + ss * s * s, P[8] = (vv - ss) * s * o, P[9] = vv * s * s + ss * o * o;
    P[2] = P[3] = P[5] = P[6] = full(0);
}
IN void predict(const World *w, v8 *x, v8 *P) {
    double t = w->dt, q = w->noise * w->noise, q0 = q * t * t * t * t / 4, q1 = q * t * t * t / 2, q2 = q * t * t;
    x[0] += t * x[2], x[1] += t * x[3];
    v8 p2 = P[2] + t * P[7], p3 = P[3] + t * P[8], p5 = P[5] + t * P[8], p6 = P[6] + t * P[9];
    P[0] += t * (P[2] + p2) + q0, P[1] += t * (P[5] + p3), P[4] += t * (P[6] + p6) + q0;
    P[2] = p2 + q1, P[3] = p3, P[5] = p5, P[6] = p6 + q1, P[7] += q2, P[9] += q2;
}
typedef struct { v8 mean[3], S[6], K[N][3], CC[N][3], I[6], determinant; } Law;
IN Law law_of_plot(const World *w, const v8 *x, const v8 *P) {
    Law l;
    Polar y = polar(x);
    v8 per = 1.0 / y.r, h1[2] = {-y.east * per, y.north * per};
    l.mean[0] = y.r, l.mean[1] = arctangent(x[1], x[0]), l.mean[2] = y.v;
    for (int i = 0; i < N; i++) {
        const int *a = AT[i];
        l.CC[i][0] = P[a[0]] * y.north + P[a[1]] * y.east, l.CC[i][1] = P[a[0]] * h1[0] + P[a[1]] * h1[1];
        l.CC[i][2] = P[a[0]] * y.along[0] + P[a[1]] * y.along[1] + P[a[2]] * y.north + P[a[3]] * y.east;
    }
    v8 (*c)[3] = l.CC, *S = l.S, *I = l.I;
    S[0] = y.north * c[0][0] + y.east * c[1][0] + w->sigma_r * w->sigma_r, S[1] = y.north * c[0][1] + y.east * c[1][1];
    S[2] = y.north * c[0][2] + y.east * c[1][2], S[3] = h1[0] * c[0][1] + h1[1] * c[1][1] + w->sigma_b * w->sigma_b;
    S[4] = h1[0] * c[0][2] + h1[1] * c[1][2];
    S[5] = y.along[0] * c[0][2] + y.along[1] * c[1][2] + y.north * c[2][2] + y.east * c[3][2] + w->sigma_v * w->sigma_v;
    v8 known = full(w->span * w->span / 100), zero = full(0); /* else the fold of the velocity is not known */
    S[2] = where_greater(known, S[5], S[2], zero), S[4] = where_greater(known, S[5], S[4], zero);
    for (int i = 0; i < N; i++) c[i][2] = where_greater(known, S[5], c[i][2], zero);
    S[5] = where_greater(full(w->span * w->span / (2 * M_PI)), S[5], S[5], full(w->span * w->span / (2 * M_PI))); /* no wider than an even density */
    I[0] = S[3] * S[5] - S[4] * S[4], I[1] = S[2] * S[4] - S[1] * S[5], I[2] = S[1] * S[4] - S[2] * S[3];
    l.determinant = S[0] * I[0] + S[1] * I[1] + S[2] * I[2];
    v8 inverse = 1.0 / l.determinant;
    I[3] = (S[0] * S[5] - S[2] * S[2]) * inverse, I[4] = (S[1] * S[2] - S[0] * S[4]) * inverse;
    I[5] = (S[0] * S[3] - S[1] * S[1]) * inverse, I[0] *= inverse, I[1] *= inverse, I[2] *= inverse;
    for (int i = 0; i < N; i++) {
        l.K[i][0] = I[0] * c[i][0] + I[1] * c[i][1] + I[2] * c[i][2];
        l.K[i][1] = I[1] * c[i][0] + I[3] * c[i][1] + I[4] * c[i][2];
        l.K[i][2] = I[2] * c[i][0] + I[4] * c[i][1] + I[5] * c[i][2];
    }
    return l;
}
IN void difference(const World *w, const Law *l, const v8 *z, v8 *d) {
    d[0] = z[0] - l->mean[0], d[1] = wrapped(z[1] - l->mean[1], 2 * M_PI), d[2] = wrapped(z[2] - l->mean[2], w->span);
}
IN void take(const Law *l, v8 *x, v8 *P, const v8 *e, v8 weight, const v8 *spread) {
    for (int i = 0; i < N; i++) {
        x[i] += l->K[i][0] * e[0] + l->K[i][1] * e[1] + l->K[i][2] * e[2];
        for (int j = i; j < N; j++)
            P[AT[i][j]] -= weight * (l->K[i][0] * l->CC[j][0] + l->K[i][1] * l->CC[j][1] + l->K[i][2] * l->CC[j][2]);
    }
    if (spread)
        for (int j = 0; j < N; j++) {
            const v8 *k = l->K[j];
            v8 s0 = spread[0] * k[0] + spread[1] * k[1] + spread[2] * k[2], s1 = spread[1] * k[0] + spread[3] * k[1] + spread[4] * k[2];
            v8 s2 = spread[2] * k[0] + spread[4] * k[1] + spread[5] * k[2];
            for (int i = 0; i <= j; i++) P[AT[i][j]] += l->K[i][0] * s0 + l->K[i][1] * s1 + l->K[i][2] * s2;
        }
}
typedef struct { v8 total, best, e[3], squares[6]; } Weighed;
IN void weigh(const World *w, const Law *l, const v8 *place, Weighed *s) {
    v8 zero = full(0), there = place[0] - 0.5, d[3];
    difference(w, l, place + 1, d);
    v8 near = where_greater(w->gate * l->S[0], d[0] * d[0], there, -full(1));
    near = where_greater(w->gate * l->S[3], d[1] * d[1], near, -full(1));
    if (!any_greater(near, zero)) return;
    const v8 *I = l->I;
    v8 square = d[0] * (I[0] * d[0] + 2.0 * (I[1] * d[1] + I[2] * d[2])) + d[1] * (I[3] * d[1] + 2.0 * I[4] * d[2]) + I[5] * d[2] * d[2];
    near = where_greater(full(w->gate), square, near, -full(1));
    v8 g = where_greater(near, zero, exponential(-0.5 * greater(square, zero)), zero);
    s->total += g, s->best = greater(s->best, g);
    for (int i = 0; i < 3; i++) s->e[i] += g * d[i];
    v8 g0 = g * d[0], g1 = g * d[1];
    s->squares[0] += g0 * d[0], s->squares[1] += g0 * d[1], s->squares[2] += g0 * d[2];
    s->squares[3] += g1 * d[1], s->squares[4] += g1 * d[2], s->squares[5] += g * d[2] * d[2];
}

/* ---- sums ---- */
IN void add(const Sums *s, int k, const v8 *x, const v8 *P, const v8 *truth, v8 counted, v8 *kept, v8 is_clear) {
    v8 zero = full(0), one = full(1), e[C], V[PACKED], J[C][N];
    Polar y = polar(x);
    v8 speed = root8(x[2] * x[2] + x[3] * x[3]), per = 1.0 / y.r, moves = where_greater(absolute(x[2]), zero, x[2], one);
    v8 slow = 1.0 / root8(moves * moves + x[3] * x[3]), vn = moves * slow, ve = x[3] * slow;
    e[0] = y.r - truth[0], e[1] = wrapped(arctangent(x[1], x[0]) - truth[1], 2 * M_PI), e[2] = speed - truth[2];
    e[3] = wrapped(arctangent(x[3], x[2]) - truth[3], 2 * M_PI);
    if (kept) {
        v8 near = where_greater(kept[1], absolute(e[0]), where_greater(kept[2], absolute(e[1]), one, zero), zero);
        kept[0] = where_greater(is_clear, zero, kept[0], kept[0] * near), counted = counted * kept[0];
    }
    v8 rows[C][2] = {{y.north, y.east}, {-y.east * per, y.north * per}, {vn, ve}, {-ve * slow, vn * slow}};
    for (int c = 0; c < C; c++)
        for (int i = 0; i < N; i++) {
            const int *a = AT[i] + (c > 1 ? 2 : 0);
            J[c][i] = P[a[0]] * rows[c][0] + P[a[1]] * rows[c][1];
        }
    for (int a = 0; a < C; a++)
        for (int b = a; b < C; b++) V[AT[a][b]] = rows[a][0] * J[b][a > 1 ? 2 : 0] + rows[a][1] * J[b][a > 1 ? 3 : 1];
    v8 L[C][C], f[C], q = zero, least = full(1);
    for (int a = 0; a < C; a++) {
        f[a] = e[a];
        for (int b = a; b < C; b++) L[b][a] = V[AT[a][b]];
    }
    for (int a = 0; a < C; a++) {
        v8 pivot = 1.0 / L[a][a];
        q += f[a] * f[a] * pivot, least = where_greater(least, L[a][a], L[a][a], least);
        for (int b = a + 1; b < C; b++) {
            v8 share = L[b][a] * pivot;
            f[b] -= share * f[a];
            for (int c = b; c < C; c++) L[c][b] -= share * L[c][a];
        }
    }
    for (int c = 0; c < C; c++) {
        v8 error = where_greater(counted, zero, e[c], zero), square = error * error;
        double *to = s->error + (k * C + c) * 4;
        to[0] += total(error), to[1] += total(square), to[2] += total(error * square);
        double fourth = total(square * square);
        to[3] += fourth, s->paired[k * C + c] += fourth;
        v8 variance = where_greater(least, zero, V[AT[c][c]], full(-1e100));
        s->believed[k * C + c] += total(where_greater(counted, zero, variance, zero));
    }
    q = where_greater(counted, zero, where_greater(least, zero, q, full(-1e100)), zero);
    s->nees[2 * k] += total(q), s->nees[2 * k + 1] += total(q * q);
}

void follow(const World *w, const Sums *s) {
    for (int g = 0; g < w->groups; g++) {
        v8 x[N], P[PACKED], counted, zero = full(0), one = full(1);
        v8 kept[3] = {one, full(10 * w->sigma_r), full(10 * w->sigma_b)}, confirmed = zero, seen[3] = {one, zero, zero};
        for (int i = 0; i < 8; i++) counted[i] = g * 8 + i < w->count;
        for (int k = 0; k < w->scans; k++) {
            const v8 *plots = (const v8 *)w->plots + (size_t)(g * w->scans + k) * w->rows;
            v8 wrong = zero;
            if (k == 0)
                begin(w, plots + 1, x, P);
            else {
                predict(w, x, P);
                Law l = law_of_plot(w, x, P);
                if (!w->places) {
                    v8 d[3];
                    difference(w, &l, plots + 1, d), take(&l, x, P, d, one, 0);
                } else {
                    double density = k > w->clear - 0.5 ? w->density : 0;
                    v8 nothing = greater(w->missed * density / w->span * l.mean[0], full(1e-290)) * 15.749609945722419 * root8(l.determinant);
                    Weighed sums = {nothing};
                    weigh(w, &l, plots, &sums);
                    v8 first = sums.best;
                    const v8 *place = plots + FIRST_FALSE, half = full(0.5);
                    for (int n = 0; n < w->places && any_greater(place[0], half); n++, place += PLACE) weigh(w, &l, place, &sums);
                    v8 per = 1.0 / sums.total, spread[6];
                    for (int i = 0; i < 3; i++) sums.e[i] *= per;
                    for (int i = 0, n = 0; i < 3; i++)
                        for (int j = i; j < 3; j++, n++) spread[n] = sums.squares[n] * per - sums.e[i] * sums.e[j];
                    take(&l, x, P, sums.e, (sums.total - nothing) * per, spread);
                    v8 has_plot = where_greater(sums.best, zero, one, zero);
                    wrong = where_greater(sums.best, first, one, zero);
                    confirmed = where_greater(has_plot + seen[0] + seen[1] + seen[2], full(2.5), one, confirmed);
                    seen[2] = seen[1], seen[1] = seen[0], seen[0] = has_plot;
                }
            }
            v8 clear = full(w->places && w->window[k] > 0 ? 0 : 1);
            add(s, k, x, P, plots + 1 + M, counted, w->places ? kept : 0, clear);
            if (w->places) {
                v8 counts = counted * kept[0];
                s->counts[3 * k] += total(counts), s->counts[3 * k + 1] += total(counts * confirmed);
                s->counts[3 * k + 2] += total(counts * wrong);
            }
        }
    }
}
