/* Times SISL on the arrays of compare/run.py.
 *   sisl grid IN OUT RUNS        interpolation s1537 of an m x n grid with given parameters
 *   sisl closest SURFACE POINTS OUT fast|safe   closest points, s1958 or s1954
 * Each run prints "T seconds". Arrays are little-endian doubles, the second index fastest. */
#include <math.h>
#include <sisl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static double seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec + 1e-9 * t.tv_nsec;
}

static double *doubles(FILE *f, long count) {
  double *p = malloc(8 * count);
  if (fread(p, 8, count, f) != (size_t)count) exit(2);
  return p;
}

/* SISL wants the first index fastest. */
static double *exchange(const double *p, long m, long n) {
  double *q = malloc(24 * m * n);
  for (long i = 0; i < m; i++)
    for (long j = 0; j < n; j++) memcpy(q + 3 * (j * m + i), p + 3 * (i * n + j), 24);
  return q;
}

static int grid(char **arg) {
  FILE *f = fopen(arg[0], "rb");
  int size[2], status = 0, runs = atoi(arg[2]);
  if (!f || fread(size, 4, 2, f) != 2) return 2;
  double *u = doubles(f, size[0]), *v = doubles(f, size[1]), *p = doubles(f, 3L * size[0] * size[1]);
  fclose(f);
  double *q = exchange(p, size[0], size[1]);
  free(p);
  SISLSurf *surface = 0;
  for (int k = 0; k < runs; k++) {
    if (surface) freeSurf(surface);
    double start = seconds();
    s1537(q, size[0], size[1], 3, u, v, 0, 0, 0, 0, 4, 4, 1, 1, &surface, &status);
    printf("T %.9g\n", seconds() - start);
  }
  return status < 0;
}

static int closest(char **arg) {
  FILE *f = fopen(arg[0], "rb");
  int h[4];
  if (!f || fread(h, 4, 4, f) != 4) return 2;
  double *tu = doubles(f, h[0] + h[2] + 1), *tv = doubles(f, h[1] + h[3] + 1), *p = doubles(f, 3L * h[0] * h[1]);
  fclose(f);
  SISLSurf *s = newSurf(h[0], h[1], h[2] + 1, h[3] + 1, tu, tv, exchange(p, h[0], h[1]), 1, 3, 1);
  f = fopen(arg[1], "rb");
  fseek(f, 0, SEEK_END);
  long count = ftell(f) / 24;
  rewind(f);
  double *points = doubles(f, 3 * count), *distance = malloc(8 * count), start = seconds();
  fclose(f);
  for (long k = 0; k < count; k++) {
    int status = 0;
    double foot[3], *x = points + 3 * k, best = -1;
    if (!strcmp(arg[3], "fast")) {
      s1958(s, x, 3, 1e-9, 1e-9, foot, &best, &status);
    } else {
      int found = 0, curves = 0, left_u = 0, left_v = 0;
      double *feet = 0, at[27], normal[3];
      SISLIntcurve **curve = 0;
      s1954(s, x, 3, 1e-9, 1e-9, &found, &feet, &curves, &curve, &status);
      for (int a = 0; a < found; a++) {
        s1421(s, 0, feet + 2 * a, &left_u, &left_v, at, normal, &status);
        double d = sqrt(pow(at[0] - x[0], 2) + pow(at[1] - x[1], 2) + pow(at[2] - x[2], 2));
        if (best < 0 || d < best) best = d;
      }
      free(feet);
      if (curve) freeIntcrvlist(curve, curves);
    }
    distance[k] = best;
  }
  printf("T %.9g\n", seconds() - start);
  f = fopen(arg[2], "wb");
  fwrite(distance, 8, count, f);
  fclose(f);
  return 0;
}

int main(int count, char **arg) {
  if (count == 5 && !strcmp(arg[1], "grid")) return grid(arg + 2);
  if (count == 6 && !strcmp(arg[1], "closest")) return closest(arg + 2);
  fprintf(stderr, "usage: see the head of sisl.c\n");
  return 2;
}
