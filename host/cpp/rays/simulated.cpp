// The device that the environment names: the model, or a simulated one, whose program this starts. Compiled with
// rays.cpp.
#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <memory>
#include <system_error>

#include "batch_bytes.hpp"
#include "simulation.hpp"

extern char** environ;

using namespace colonnade::rays;

namespace {

/// The content of the file that a variable names.
std::string contentOf(const char* variable) {
    const char* const name = std::getenv(variable);
    if (!name) throw std::invalid_argument("names no file");
    std::ifstream file(name);
    std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    if (!file) throw std::invalid_argument("cannot read " + std::string(name));
    return text;
}

/// Prints the one line of a failure of what a variable names.
void report(const char* variable, const char* text) {
    std::fprintf(stderr, "colonnade: error: %s: %s\n", variable, text);
}

/// A program with pipes for its standard streams. It ends with its input.
class Program {
public:
    /// `words`: its path and its arguments.
    explicit Program(const std::vector<std::string>& words) {
        posix_spawn_file_actions_t actions;
        posix_spawn_file_actions_init(&actions);
        int error = 0;
        for (int stream = 0; stream < 3 && error == 0; ++stream) {
            error = pipe2(pipes_[stream], O_CLOEXEC) == 0 ? 0 : errno;
            if (error == 0) posix_spawn_file_actions_adddup2(&actions, theirs(stream), stream);
        }
        std::vector<char*> arguments;
        for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
        arguments.push_back(nullptr);
        if (error == 0) error = posix_spawn(&process_, arguments[0], &actions, nullptr, arguments.data(), environ);
        posix_spawn_file_actions_destroy(&actions);
        for (int stream = 0; stream < 3; ++stream) shut(theirs(stream));
        if (error == 0) return;
        closeStreams();
        throw std::system_error(error, std::generic_category(), words[0]);
    }
    ~Program() {
        closeStreams();
        while (waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {}
    }
    Program(const Program&) = delete;

    Streams streams() const { return {pipes_[0][1], pipes_[1][0], pipes_[2][0]}; }

private:
    /// The end of a pipe that the program has: it reads the first one.
    int& theirs(int stream) { return pipes_[stream][stream != 0]; }
    int& ours(int stream) { return pipes_[stream][stream == 0]; }
    static void shut(int& descriptor) {
        if (descriptor >= 0) ::close(descriptor);
        descriptor = -1;
    }
    void closeStreams() {
        for (int stream = 0; stream < 3; ++stream) shut(ours(stream));
    }

    int pipes_[3][2] = {{-1, -1}, {-1, -1}, {-1, -1}};
    pid_t process_ = -1;
};

/// What a file says of a simulated device: the words that start its program, and lines of its registers.
struct Description {
    std::vector<std::string> words;
    std::string registers;

    explicit Description(const std::string& text) {
        std::istringstream lines(text);
        for (std::string line; std::getline(lines, line);) {
            const std::string prefix = words.empty() ? "program " : "argument ";
            if (line.rfind(prefix, 0) == 0) words.push_back(line.substr(prefix.size()));
            else if (words.empty()) throw std::invalid_argument("its first line names no program");
            else registers += line + '\n';
        }
        if (words.empty()) throw std::invalid_argument("it is empty");
    }
};

/// The simulated device as a backend.
class SimulatedDevice {
public:
    explicit SimulatedDevice(const Description& description)
        : program_(description.words), simulation_(description.registers, program_.streams()) {}

    colonnade_rays_backend backend() {
        return {this,
                [](void* self, const colonnade_rays_image* image) {
                    return call(self, [&](SimulatedDevice& device) { device.load(*image); });
                },
                [](void* self, const colonnade_rays_batch* batch) {
                    return call(self, [&](SimulatedDevice& device) { device.submit(*batch); });
                },
                [](void* self) {
                    return std::exchange(static_cast<SimulatedDevice*>(self)->status_,
                                         static_cast<int>(COLONNADE_RAYS_OK));
                },
                [](void* self, colonnade_rays_sums* sums) {
                    call(self, [&](SimulatedDevice& device) { *sums = sumsOf(device.simulation_.counters()); });
                },
                [](void* self) { delete static_cast<SimulatedDevice*>(self); }};
    }

private:
    /// The status of a call; prints the first failure.
    template <class Call> static int call(void* self, const Call& of) {
        auto& device = *static_cast<SimulatedDevice*>(self);
        try {
            of(device);
            return COLONNADE_RAYS_OK;
        } catch (const std::exception& error) {
            if (!std::exchange(device.hasFailed_, true)) report("rays", error.what());
            return COLONNADE_RAYS_DEVICE;
        }
    }

    void load(const colonnade_rays_image& image) {
        simulation_.load(registersOf(image), image.records, image.record_count, image.record_bytes);
    }

    void submit(const colonnade_rays_batch& batch) {
        const std::uint32_t tag = simulation_.submit(batch, reinterpret_cast<const void*>(batch.rays), rayBytes(batch),
                                                     reinterpret_cast<void*>(batch.hits), responseBytes(batch));
        if (batch.done != 0) *reinterpret_cast<std::uint32_t*>(batch.done) = tag;
        if (tag >> 31) status_ = COLONNADE_RAYS_DEVICE;
    }

    Program program_;
    Simulation simulation_;
    int status_ = COLONNADE_RAYS_OK;
    bool hasFailed_ = false;
};

} // namespace

int colonnade_rays_open_environment(colonnade_rays_device** device) {
    *device = nullptr;
    const char *const designName = "COLONNADE_RAYS_DESIGN", *const deviceName = "COLONNADE_RAYS_DEVICE";
    const char* variable = designName;
    try {
        const bool hasDesign = std::getenv(designName);
        const std::string design = hasDesign ? contentOf(variable) : "";
        std::unique_ptr<SimulatedDevice> simulated;
        colonnade_rays_backend backend{};
        if (std::getenv(deviceName)) {
            variable = deviceName;
            simulated = std::make_unique<SimulatedDevice>(Description(contentOf(variable)));
            backend = simulated->backend();
        }
        const int status =
            colonnade_rays_open(hasDesign ? design.c_str() : nullptr, simulated ? &backend : nullptr, device);
        if (status == COLONNADE_RAYS_OK) {
            simulated.release(); // The library closes it
            return status;
        }
        report(designName, *device ? colonnade_rays_error(*device) : "there is not enough memory");
        colonnade_rays_close(*device);
        *device = nullptr;
        return status;
    } catch (const std::exception& error) {
        report(variable, error.what());
        return COLONNADE_RAYS_BAD_DESIGN;
    }
}
