// Event-driven simulator of a gate netlist with one delay per gate. It counts the transitions of each net.
//
//   gates NETLIST STIMULUS CYCLES BEGIN OUTPUTS COUNTS
//
// NETLIST has one item per line. Nets are numbers. A truth table has a 0 or 1 for each combination of inputs, with the
// first input as the least significant bit; constant inputs are folded into the tables. Delays are in ps:
//   nets N
//   input NET | -            next bit of the inputs, least significant first; "-" is an unused bit
//   output NET | 0 | 1       next bit of the outputs; a net is written as "n5"
//   tie NET VALUE
//   gate NET DELAY TABLE NET…
//   register NET DELAY INITIAL TABLE NET…   loads the table's value at each clock edge
//   memory DEPTH WIDTH       the following ports belong to it
//   port ADDRESS ENABLE WRITES DATA_IN DATA_OUT   comma-separated bits "n5", "0" or "1", least significant first, or
//       "-"
// STIMULUS holds the inputs of each cycle in whole bytes, least significant first. OUTPUTS receives the outputs before
// each clock edge in the same form. COUNTS receives "memory READS WRITES" for each memory and "net CHANGES SETTLED
// HIGH" for each net, over the cycles from BEGIN on: all transitions, cycles with a changed final value, cycles that
// end high.
//
// Delays are inertial: a gate suppresses pulses shorter than its delay. In each cycle registers change first, then
// inputs. The netlist settles before the next edge, without a time limit of the clock. All nets start at zero.
// Progress goes to standard error as "progress SHARE". Exit status 0, or 3 on an error.
#include <cstdint>
#include <fstream>
#include <iostream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

constexpr unsigned inputDelay = 10, memoryDelay = 20;

/// A bit of a memory's port: a net, or a constant.
struct Bit {
    int net = -1;
    bool constant = false;
};

struct Gate {
    unsigned output = 0, delay = 1, index = 0;
    const std::vector<char>* table = nullptr;
    bool isPending = false;
    unsigned stamp = 0;
};

struct Port {
    std::vector<Bit> address, enable, writes, dataIn, dataOut;
    std::uint64_t readAddress = 0;
    bool isRead = false;
};

struct Memory {
    unsigned width = 0;
    std::vector<std::vector<char>> words;
    std::vector<Port> ports;
    std::uint64_t reads = 0, writes = 0;
};

struct Reader {
    unsigned gate, mask;
};

struct Count {
    std::uint64_t changes = 0, settled = 0, high = 0;
};

/// A net takes a value. `gate` drives the net, or is -1. An event is cancelled if its stamp is not the gate's stamp.
struct Event {
    unsigned net;
    int gate;
    unsigned stamp;
    char value;
};

class Netlist {
public:
    explicit Netlist(const std::string& file) {
        std::ifstream stream(file);
        for (std::string line; std::getline(stream, line);) item(line);
        link();
        begin();
    }

    void run(const std::string& stimulus, std::uint64_t cycles, std::uint64_t first, const std::string& outputs) {
        std::ifstream source(stimulus, std::ios::binary);
        std::ofstream sink(outputs, std::ios::binary);
        std::vector<char> bytes((inputs_.size() + 7) / 8);
        for (std::uint64_t cycle = 0; cycle < cycles; ++cycle) {
            if (!source.read(bytes.data(), static_cast<std::streamsize>(bytes.size())))
                throw std::runtime_error("too few inputs");
            for (std::size_t i = 0; i < inputs_.size(); ++i) {
                const char value = static_cast<char>(bytes[i / 8] >> (i % 8) & 1);
                if (inputs_[i] >= 0 && values_[static_cast<unsigned>(inputs_[i])] != value)
                    schedule(inputDelay, {static_cast<unsigned>(inputs_[i]), -1, 0, value});
            }
            settle();
            write(sink);
            endCycle();
            isCounting_ = cycle + 1 >= first;
            if (cycle + 1 < cycles) edge();
            if (cycle % 64 == 0)
                std::cerr << "progress " << static_cast<double>(cycle) / static_cast<double>(cycles) << std::endl;
        }
    }

    void report(const std::string& file) const {
        std::ofstream stream(file);
        for (const Memory& memory : memories_) stream << "memory " << memory.reads << ' ' << memory.writes << '\n';
        for (const Count& count : counts_)
            stream << "net " << count.changes << ' ' << count.settled << ' ' << count.high << '\n';
    }

private:
    void item(const std::string& line) {
        std::istringstream words(line);
        std::string kind, word;
        words >> kind;
        if (kind == "nets") {
            std::size_t nets = 0;
            words >> nets;
            values_.assign(nets, 0);
            before_.assign(nets, 0);
            touched_.assign(nets, 0);
            counts_.resize(nets);
            readers_.resize(nets);
        } else if (kind == "input") {
            words >> word;
            inputs_.push_back(word == "-" ? -1 : std::stoi(word));
        } else if (kind == "output") {
            words >> word;
            outputs_.push_back(bitOf(word));
        } else if (kind == "tie") {
            unsigned net = 0, value = 0;
            words >> net >> value;
            firsts_.push_back({net, -1, 0, static_cast<char>(value)});
        } else if (kind == "gate" || kind == "register") {
            Gate gate;
            words >> gate.output >> gate.delay;
            if (kind == "register") {
                unsigned value = 0;
                words >> value;
                firsts_.push_back({gate.output, -1, 0, static_cast<char>(value)});
            }
            words >> word;
            gate.table = tableOf(word);
            const unsigned number = static_cast<unsigned>(gates_.size());
            unsigned net = 0, mask = 1;
            for (; words >> net; mask <<= 1) readers_.at(net).push_back({number, mask});
            if (mask != gate.table->size()) throw std::runtime_error("truth table and inputs differ in size: " + line);
            isRegister_.push_back(kind == "register");
            gates_.push_back(gate);
        } else if (kind == "memory") {
            std::size_t depth = 0;
            memories_.emplace_back();
            words >> depth >> memories_.back().width;
            memories_.back().words.assign(depth, std::vector<char>(memories_.back().width, 0));
        } else if (kind == "port") {
            Port port;
            for (auto* bits : {&port.address, &port.enable, &port.writes, &port.dataIn, &port.dataOut}) {
                words >> word;
                *bits = bitsOf(word);
            }
            memories_.back().ports.push_back(port);
        } else {
            throw std::runtime_error("unknown item: " + line);
        }
        if (!words && !words.eof()) throw std::runtime_error("cannot parse: " + line);
    }

    static Bit bitOf(const std::string& word) {
        if (word.at(0) == 'n') return {std::stoi(word.substr(1)), false};
        return {-1, word == "1"};
    }

    static std::vector<Bit> bitsOf(const std::string& words) {
        std::vector<Bit> bits;
        std::istringstream stream(words);
        for (std::string word; words != "-" && std::getline(stream, word, ',');) bits.push_back(bitOf(word));
        return bits;
    }

    const std::vector<char>* tableOf(const std::string& word) {
        for (const auto& [text, table] : tables_)
            if (text == word) return table;
        auto* table = new std::vector<char>; // never freed
        for (const char digit : word) table->push_back(static_cast<char>(digit == '1'));
        tables_.emplace_back(word, table);
        return table;
    }

    /// Flattens the readers of all nets into one array.
    void link() {
        for (const auto& readers : readers_) {
            begins_.push_back(static_cast<unsigned>(flat_.size()));
            flat_.insert(flat_.end(), readers.begin(), readers.end());
        }
        begins_.push_back(static_cast<unsigned>(flat_.size()));
        readers_.clear();
        wheel_.resize(slots);
    }

    /// Settles the netlist from zero with the initial values of registers, constants and gates.
    void begin() {
        for (const Event& event : firsts_)
            if (event.value) schedule(1, event);
        for (unsigned gate = 0; gate < gates_.size(); ++gate)
            if (!isRegister_[gate]) evaluate(gate);
        settle();
        before_ = values_;
        for (const unsigned net : changed_) touched_[net] = 0;
        changed_.clear();
    }

    void schedule(unsigned delay, const Event& event) {
        if (delay >= slots) throw std::runtime_error("a gate's delay is too long");
        wheel_[(now_ + delay) % slots].push_back(event);
        ++waiting_;
    }

    /// Schedules a gate's new output after its delay, or cancels a pending event.
    void evaluate(unsigned number) {
        Gate& gate = gates_[number];
        const char value = (*gate.table)[gate.index];
        if (value == values_[gate.output]) {
            if (gate.isPending) ++gate.stamp;
            gate.isPending = false;
        } else if (!gate.isPending) {
            gate.isPending = true;
            schedule(gate.delay, {gate.output, static_cast<int>(number), gate.stamp, value});
        }
    }

    /// Processes events until none is left.
    void settle() {
        for (std::uint64_t limit = now_ + longest; waiting_ > 0; ++now_) {
            auto& slot = wheel_[now_ % slots];
            for (std::size_t i = 0; i < slot.size(); ++i) apply(Event(slot[i]));
            waiting_ -= slot.size();
            slot.clear();
            if (now_ > limit) throw std::runtime_error("the gates do not settle");
        }
    }

    void apply(const Event& event) {
        if (event.gate >= 0) {
            Gate& gate = gates_[static_cast<unsigned>(event.gate)];
            if (!gate.isPending || gate.stamp != event.stamp) return;
            gate.isPending = false;
            ++gate.stamp;
        }
        if (values_[event.net] == event.value) return;
        values_[event.net] = event.value;
        if (!touched_[event.net]) {
            touched_[event.net] = 1;
            changed_.push_back(event.net);
        }
        if (isCounting_) ++counts_[event.net].changes;
        for (unsigned i = begins_[event.net]; i < begins_[event.net + 1]; ++i) {
            gates_[flat_[i].gate].index ^= flat_[i].mask;
            if (!isRegister_[flat_[i].gate]) evaluate(flat_[i].gate);
        }
    }

    /// Clock edge of memories and registers.
    void edge() {
        for (Memory& memory : memories_) clock(memory);
        for (unsigned number = 0; number < gates_.size(); ++number) {
            if (!isRegister_[number]) continue;
            const Gate& gate = gates_[number];
            const char value = (*gate.table)[gate.index];
            if (value != values_[gate.output]) schedule(gate.delay, {gate.output, -1, 0, value});
        }
    }

    void clock(Memory& memory) {
        for (Port& port : memory.ports) {
            const bool isEnabled = number(port.enable) != 0, isWrite = isEnabled && number(port.writes) != 0;
            port.isRead = isEnabled && !isWrite;
            port.readAddress = number(port.address);
            if (isWrite) {
                auto& word = memory.words.at(port.readAddress);
                for (std::size_t i = 0; i < port.dataIn.size(); ++i) word[i] = value(port.dataIn[i]);
            }
            if (isCounting_ && isEnabled) ++(isWrite ? memory.writes : memory.reads);
        }
        for (const Port& port : memory.ports)
            for (std::size_t i = 0; i < port.dataOut.size(); ++i) {
                const char bit = port.isRead ? memory.words.at(port.readAddress)[i] : static_cast<char>(0);
                if (port.dataOut[i].net >= 0 && value(port.dataOut[i]) != bit)
                    schedule(memoryDelay, {static_cast<unsigned>(port.dataOut[i].net), -1, 0, bit});
            }
    }

    char value(const Bit& bit) const {
        return bit.net >= 0 ? values_[static_cast<unsigned>(bit.net)] : static_cast<char>(bit.constant);
    }

    std::uint64_t number(const std::vector<Bit>& bits) const {
        std::uint64_t sum = 0;
        for (std::size_t i = 0; i < bits.size(); ++i) sum |= static_cast<std::uint64_t>(value(bits[i])) << i;
        return sum;
    }

    void endCycle() {
        for (const unsigned net : changed_) {
            touched_[net] = 0;
            if (isCounting_ && values_[net] != before_[net]) ++counts_[net].settled;
            before_[net] = values_[net];
        }
        changed_.clear();
        if (isCounting_)
            for (std::size_t net = 0; net < values_.size(); ++net)
                counts_[net].high += static_cast<unsigned char>(values_[net]);
    }

    void write(std::ostream& sink) const {
        std::vector<char> bytes((outputs_.size() + 7) / 8, 0);
        for (std::size_t i = 0; i < outputs_.size(); ++i)
            bytes[i / 8] = static_cast<char>(bytes[i / 8] | value(outputs_[i]) << (i % 8));
        sink.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    }

    static constexpr std::uint64_t slots = 1 << 16, longest = 1 << 24;

    std::vector<Gate> gates_;
    std::vector<char> isRegister_, values_, before_, touched_;
    std::vector<Memory> memories_;
    std::vector<int> inputs_;
    std::vector<Bit> outputs_;
    std::vector<Event> firsts_;
    std::vector<Count> counts_;
    std::vector<std::vector<Reader>> readers_;
    std::vector<Reader> flat_;
    std::vector<unsigned> begins_, changed_;
    std::vector<std::pair<std::string, const std::vector<char>*>> tables_;
    std::vector<std::vector<Event>> wheel_;
    std::uint64_t now_ = 0, waiting_ = 0;
    bool isCounting_ = false;
};

} // namespace

int main(int argc, char** argv) try {
    if (argc != 7) throw std::runtime_error("usage: gates NETLIST STIMULUS CYCLES BEGIN OUTPUTS COUNTS");
    Netlist netlist(argv[1]);
    netlist.run(argv[2], std::stoull(argv[3]), std::stoull(argv[4]), argv[5]);
    netlist.report(argv[6]);
    return 0;
} catch (const std::exception& problem) {
    std::cerr << "gates: " << problem.what() << '\n';
    return 3;
}
