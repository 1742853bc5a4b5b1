/* Springs in space by leapfrog. SCATTER adds each force to both ends at once; KEPT computes all forces in a loop that becomes vectors,
   and then sums those of each particle in the order of the springs. PARTICLES and SPRINGS are known to the compiler.

   in: v, y, pairs, stiffness, rest, 1/m (0 where a particle is fixed), gravity. */

#include <math.h>
#include <string.h>

static int first[SPRINGS], second[SPRINGS], from[PARTICLES + 1], of[2 * SPRINGS];
static double x[3][PARTICLES], u[3][PARTICLES], f[3][PARTICLES], kept[3][SPRINGS], turned[2 * SPRINGS];

static void order(const double *pairs)
{
    int at[PARTICLES];
    memset(from, 0, sizeof from);
    for (int s = 0; s < SPRINGS; s++) {
        first[s] = (int)pairs[2 * s];
        second[s] = (int)pairs[2 * s + 1];
        from[first[s] + 1]++;
        from[second[s] + 1]++;
    }
    for (int i = 0; i < PARTICLES; i++) {
        from[i + 1] += from[i];
        at[i] = from[i];
    }
    for (int s = 0; s < SPRINGS; s++) {
        of[at[first[s]]] = s;
        turned[at[first[s]]++] = 1.0;
        of[at[second[s]]] = s;
        turned[at[second[s]]++] = -1.0;
    }
}

void cloth_leapfrog(long n, long steps, double h, const double *const *in, double *v_out, double *y_out)
{
    const double *k = in[3], *rest = in[4], *by_mass = in[5], *gravity = in[6];
    (void)n;
    order(in[2]);
    for (int i = 0; i < PARTICLES; i++)
        for (int c = 0; c < 3; c++) {
            u[c][i] = in[0][3 * i + c];
            x[c][i] = in[1][3 * i + c];
        }
    for (long step = 0; step <= steps; step++) {
        double kick = step > 0 && step < steps ? h : 0.5 * h, drift = step < steps ? h : 0.0;
        memset(f, 0, sizeof f);
        for (int s = 0; s < SPRINGS; s++) {
            int i = first[s], j = second[s];
            double a = x[0][j] - x[0][i], b = x[1][j] - x[1][i], c = x[2][j] - x[2][i];
            double length = sqrt(a * a + b * b + c * c), pull = k[s] * (length - rest[s]) * (1.0 / length);
#ifdef SCATTER
            f[0][i] += pull * a, f[1][i] += pull * b, f[2][i] += pull * c;
            f[0][j] -= pull * a, f[1][j] -= pull * b, f[2][j] -= pull * c;
#else
            kept[0][s] = pull * a, kept[1][s] = pull * b, kept[2][s] = pull * c;
#endif
        }
#ifndef SCATTER
        for (int i = 0; i < PARTICLES; i++) {
            double a = 0.0, b = 0.0, c = 0.0;
            for (int e = from[i]; e < from[i + 1]; e++) {
                int s = of[e];
                a += turned[e] * kept[0][s], b += turned[e] * kept[1][s], c += turned[e] * kept[2][s];
            }
            f[0][i] = a, f[1][i] = b, f[2][i] = c;
        }
#endif
        for (int c = 0; c < 3; c++)
            for (int i = 0; i < PARTICLES; i++) {
                double w = kick * by_mass[i], fall = by_mass[i] > 0.0 ? kick * gravity[c] : 0.0;
                u[c][i] += w * f[c][i] + fall;
                x[c][i] += drift * u[c][i];
            }
    }
    for (int i = 0; i < PARTICLES; i++)
        for (int c = 0; c < 3; c++) {
            v_out[3 * i + c] = u[c][i];
            y_out[3 * i + c] = x[c][i];
        }
}
