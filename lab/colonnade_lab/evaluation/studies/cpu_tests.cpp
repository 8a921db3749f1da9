// Every ray tests every triangle, after Möller and Trumbore, in double: CPU seconds and rays that hit.
// Usage: cpu_tests FILE TRIANGLES RAYS; FILE has triangles double[9]: corner, edges from it; rays double[6]: origin,
// direction
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

struct Vector {
    double x, y, z;
};

static Vector operator-(const Vector &a, const Vector &b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
static Vector cross(const Vector &a, const Vector &b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
static double dot(const Vector &a, const Vector &b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

struct Triangle {
    Vector corner, along, across;
};

struct Ray {
    Vector origin, direction;
};

// The distance to a triangle; infinity if the ray misses it.
static double distance(const Ray &ray, const Triangle &triangle) {
    const Vector normal = cross(ray.direction, triangle.across);
    const double determinant = dot(triangle.along, normal);
    if (std::fabs(determinant) < 1e-300) return INFINITY;
    const Vector start = ray.origin - triangle.corner;
    const double u = dot(start, normal) / determinant;
    if (u < 0 || u > 1) return INFINITY;
    const Vector other = cross(start, triangle.along);
    const double v = dot(ray.direction, other) / determinant;
    if (v < 0 || u + v > 1) return INFINITY;
    const double t = dot(triangle.across, other) / determinant;
    return t > 0 ? t : INFINITY;
}

template <typename Item> static std::vector<Item> items(std::FILE *file, const char *count) {
    std::vector<Item> result(std::strtoul(count, nullptr, 10));
    if (std::fread(result.data(), sizeof(Item), result.size(), file) != result.size()) std::exit(1);
    return result;
}

int main(int, char **words) {
    std::FILE *const file = std::fopen(words[1], "rb");
    if (!file) return 1;
    const std::vector<Triangle> triangles = items<Triangle>(file, words[2]);
    const std::vector<Ray> rays = items<Ray>(file, words[3]);
    long hits = 0;
    const std::clock_t begin = std::clock();
    for (const Ray &ray : rays) {
        double nearest = INFINITY;
        for (const Triangle &triangle : triangles) nearest = std::fmin(nearest, distance(ray, triangle));
        hits += nearest < INFINITY;
    }
    std::printf("%.6f %ld\n", static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC, hits);
}
