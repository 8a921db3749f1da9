// A bench of a design with one column: a frame of its RTL, in slices of cycles. Pixels are taken when they come.
#include <cstdint>
#include <cstring>
#include <memory>
#include <vector>

#include "VColonnade.h"
#include "verilated_threads.h"

// A model with one thread makes no pool.
VlThreadPool::VlThreadPool(VerilatedContext*, unsigned) {}
VlThreadPool::~VlThreadPool() {}

namespace {

std::unique_ptr<VColonnade> top;
std::vector<std::uint16_t> colours;
std::vector<std::int32_t> triangles;
std::size_t width;

void cycle() {
    top->eval();
    if (top->io_pixels_0_valid) {
        const std::size_t pixel = top->io_pixels_0_bits_y * width + top->io_pixels_0_bits_x;
        if (pixel < triangles.size()) {
            colours[3 * pixel] = top->io_pixels_0_bits_colour_r;
            colours[3 * pixel + 1] = top->io_pixels_0_bits_colour_g;
            colours[3 * pixel + 2] = top->io_pixels_0_bits_colour_b;
            triangles[pixel] =
                top->io_pixels_0_bits_isObject ? static_cast<std::int32_t>(top->io_pixels_0_bits_hit_triangle) : -1;
        }
    }
    top->clock = !top->clock; // registers have both edges
    top->eval();
}

} // namespace

extern "C" {

/// Resets the device, and loads records through its load port.
void rtl_load(const std::uint8_t* records, std::uint32_t count, std::uint32_t bytes) {
    top = std::make_unique<VColonnade>();
    top->io_pixels_0_ready = 1;
    top->reset = 1;
    for (int i = 0; i < 8; ++i) cycle();
    top->reset = 0;
    cycle();
    top->io_load_valid = 1;
    for (std::uint32_t address = 0; address < count; ++address) {
        top->io_load_bits_target = 0;
        top->io_load_bits_address = address;
        std::memset(&top->io_load_bits_record, 0, sizeof top->io_load_bits_record);
        std::memcpy(&top->io_load_bits_record, records + address * bytes, bytes);
        cycle();
    }
    top->io_load_valid = 0;
}

/// Writes a register's word.
void rtl_write(std::uint32_t address, std::uint32_t value) {
    top->io_register_write = 1;
    top->io_register_address = address;
    top->io_register_writeData = value;
    cycle();
    top->io_register_write = 0;
}

std::uint32_t rtl_read(std::uint32_t address) {
    top->io_register_read = 1;
    top->io_register_address = address;
    cycle();
    top->io_register_read = 0;
    return top->io_register_readData;
}

/// Starts a frame by a write to `control.start`.
void rtl_begin(std::uint32_t frameWidth, std::uint32_t frameHeight, std::uint32_t start) {
    width = frameWidth;
    colours.assign(3 * std::size_t{frameWidth} * frameHeight, 0);
    triangles.assign(std::size_t{frameWidth} * frameHeight, -2);
    rtl_write(start, 1);
}

/// Simulates so many cycles at most; returns how many, fewer if the frame has ended.
std::uint32_t rtl_run(std::uint32_t cycles) {
    std::uint32_t done = 0;
    for (; done < cycles && !top->io_done; ++done) cycle();
    return done;
}

const std::uint16_t* rtl_colours(void) { return colours.data(); }
const std::int32_t* rtl_triangles(void) { return triangles.data(); }
}
