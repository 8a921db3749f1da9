// Testbench of the AXI4 shell: executes the commands of a job on the Verilated ColonnadeAxi, one command per line. The
// job is a file, or "-" for the standard input: then a driver in another process can send commands and read what they
// print.
//
//   store FILE ADDRESS         writes a file into the memory
//   write ADDRESS VALUE        writes a register word by AXI4-Lite
//   read NAME ADDRESS WORDS    prints "value NAME VALUE"
//   wait CYCLES                waits for the interrupt, so many cycles at most; prints "waited CYCLES"
//   run CYCLES                 goes on for so many cycles, or until the interrupt; prints "ran CYCLES"
//   dump FILE ADDRESS BYTES    writes a range of the memory to a file; bytes that were never written are 0xA5
//   fail BEATS                 so many of 1024 beats of the scene's reads are answered with an error from now on
//   bus LATENCY STALL ORDER ERRORS SEED    the memory of the masters, not of the scene, from now on: as the options,
//                              and so many of 1024 of its answers are errors
//
// Options: --bus BYTES of the data bus; --memory BYTES of memory, from address --base N (0); --shared FILE, which is
// the memory, and which other programs may also map; --latency CYCLES of an answer; --stall PERCENT of cycles in which
// a channel does not move; --order N of a write's address and data (WriteOrder); --seed N of stalls and of the state at
// power-up. An access beyond the memory, an answer with an error, or a broken rule of AXI ends the run. Exit status 0,
// or 3 on an error.
#include <cstdint>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>

#include "batch_sequences.hpp"
#include "frame_sequences.hpp"
#include "shell_memory.hpp"

namespace {

class Harness {
public:
    Harness(std::map<std::string, unsigned>& options, const std::string& shared) : memory_(top_, options, shared) {
        top_.s_axil_awvalid = top_.s_axil_wvalid = top_.s_axil_bready = top_.s_axil_arvalid = top_.s_axil_rready = 0;
        top_.s_axil_awprot = top_.s_axil_arprot = 0;
        top_.reset = 1;
        // Outputs mean nothing before the first edges: the registers begin with random values
        for (int i = 0; i < 2; ++i) {
            top_.clock = 1;
            top_.eval();
            top_.clock = 0;
            top_.eval();
        }
        for (int i = 0; i < 8; ++i) cycle();
        top_.reset = 0;
        cycle();
    }

    void store(const std::string& file, std::uint64_t address) {
        std::ifstream stream(file, std::ios::binary | std::ios::ate);
        if (!stream) throw std::runtime_error("no file " + file);
        const auto size = static_cast<std::uint64_t>(stream.tellg());
        stream.seekg(0).read(reinterpret_cast<char*>(memory_.range(address, size)), static_cast<std::streamsize>(size));
    }

    void dump(const std::string& file, std::uint64_t address, std::uint64_t size) {
        std::ofstream(file, std::ios::binary)
            .write(reinterpret_cast<const char*>(memory_.range(address, size)), static_cast<std::streamsize>(size));
    }

    void write(unsigned address, std::uint32_t value) {
        top_.s_axil_awaddr = static_cast<std::uint16_t>(address);
        top_.s_axil_wdata = value;
        top_.s_axil_wstrb = 15;
        top_.s_axil_awvalid = top_.s_axil_wvalid = top_.s_axil_bready = 1;
        while (!top_.s_axil_bvalid) {
            const bool isAddressTaken = top_.s_axil_awready, isDataTaken = top_.s_axil_wready;
            cycle();
            if (isAddressTaken) top_.s_axil_awvalid = 0;
            if (isDataTaken) top_.s_axil_wvalid = 0;
        }
        const bool isError = top_.s_axil_bresp != 0;
        cycle();
        top_.s_axil_bready = 0;
        if (isError) throw std::runtime_error("a write to the register at " + std::to_string(address) + " was refused");
    }

    std::uint32_t read(unsigned address) {
        top_.s_axil_araddr = static_cast<std::uint16_t>(address);
        top_.s_axil_arvalid = top_.s_axil_rready = 1;
        while (!top_.s_axil_rvalid) {
            const bool isTaken = top_.s_axil_arready;
            cycle();
            if (isTaken) top_.s_axil_arvalid = 0;
        }
        const std::uint32_t value = top_.s_axil_rdata;
        const bool isError = top_.s_axil_rresp != 0;
        cycle();
        top_.s_axil_rready = 0;
        if (isError) throw std::runtime_error("a read of the register at " + std::to_string(address) + " was refused");
        return value;
    }

    void fail(unsigned errorsPer1024) { memory_.failScene(errorsPer1024); }

    void setBus(const MasterTiming& timing) { memory_.set(timing); }

    std::uint64_t wait(std::uint64_t most) {
        std::uint64_t cycles = 0;
        for (; !top_.irq; ++cycles) {
            if (cycles == most) throw std::runtime_error("no interrupt after " + std::to_string(most) + " cycles");
            cycle();
        }
        return cycles;
    }

    std::uint64_t run(std::uint64_t most) {
        std::uint64_t cycles = 0;
        for (; cycles < most && !top_.irq; ++cycles) cycle();
        return cycles;
    }

private:
    void cycle() {
        memory_.offer();
        memory_.take();
        top_.clock = 1;
        top_.eval();
        memory_.finish();
        top_.clock = 0;
        top_.eval();
    }

    VColonnadeAxi top_;
    Memory memory_;
};

void run(const std::string& job, std::map<std::string, unsigned>& options, const std::string& shared) {
    Harness harness(options, shared);
    std::ifstream file(job);
    std::istream& stream = job == "-" ? std::cin : file;
    if (job == "-") std::cout << std::unitbuf;
    if (!stream) throw std::runtime_error("no job " + job);
    for (std::string line; std::getline(stream, line);) {
        std::istringstream words(line);
        std::string command, name;
        std::uint64_t first = 0, second = 0;
        words >> command;
        if (command == "bus") {
            MasterTiming timing;
            if (!(words >> timing.latency >> timing.stall >> timing.order >> timing.errorsPer1024 >> timing.seed))
                throw std::runtime_error("cannot parse: " + line);
            harness.setBus(timing);
            continue;
        }
        const bool isNumber = command == "wait" || command == "run" || command == "fail";
        if (command != "write" && !isNumber) words >> name;
        words >> first;
        if (command != "store" && !isNumber) words >> second;
        if (!words) throw std::runtime_error("cannot parse: " + line);
        if (command == "store") harness.store(name, first);
        else if (command == "dump") harness.dump(name, first, second);
        else if (command == "write") harness.write(static_cast<unsigned>(first), static_cast<std::uint32_t>(second));
        else if (command == "fail") harness.fail(static_cast<unsigned>(first));
        else if (command == "wait") std::cout << "waited " << harness.wait(first) << '\n';
        else if (command == "run") std::cout << "ran " << harness.run(first) << '\n';
        else if (command == "read") {
            std::uint64_t value = 0;
            for (unsigned word = 0; word < second; ++word)
                value |= static_cast<std::uint64_t>(harness.read(static_cast<unsigned>(first) + 4 * word))
                         << (32 * word);
            std::cout << "value " << name << ' ' << value << '\n';
        } else throw std::runtime_error("unknown command: " + line);
    }
}

/// Runs sequences of consecutive seeds; prints what was broken, and counts. Ends after ten that broke a rule: hangs
/// take long.
int runSequences(const std::string& job, std::map<std::string, unsigned>& options) {
    const SequenceJob parsed(job);
    std::unique_ptr<Sequences> sequences;
    if (parsed.batches.empty())
        sequences = std::make_unique<FrameSequences>(parsed, options["--bus"], options["--memory"]);
    else sequences = std::make_unique<BatchSequences>(parsed, options["--bus"], options["--memory"]);
    for (unsigned i = 0; i < options["--sequences"] && sequences->failed() < 10; ++i)
        sequences->run(options["--seed"] + i);
    sequences->print();
    return 0;
}

} // namespace

int main(int argc, char** argv) try {
    std::map<std::string, unsigned> options{{"--bus", 0},   {"--memory", 0}, {"--base", 0}, {"--latency", 1},
                                            {"--stall", 0}, {"--order", 0},  {"--seed", 1}, {"--sequences", 0}};
    std::string job, shared;
    for (int i = 1; i < argc; ++i) {
        const std::string argument = argv[i];
        if (argument.rfind("--", 0) != 0) job = argument;
        else if (argument == "--shared" && i + 1 < argc) shared = argv[++i];
        else if (options.count(argument) == 0) throw std::runtime_error("unknown option: " + argument);
        else if (++i < argc) options[argument] = static_cast<unsigned>(std::stoul(argv[i]));
        else throw std::runtime_error(argument + " needs a number");
    }
    Verilated::randReset(2);
    Verilated::randSeed(static_cast<int>(options["--seed"]));
    if (options["--sequences"] != 0) return runSequences(job, options);
    run(job, options, shared);
    return 0;
} catch (const std::exception& problem) {
    std::cerr << "harness: " << problem.what() << '\n';
    return 3;
}
