package colonnade

import colonnade.bus._
import colonnade.column.FakePathTracer
import colonnade.config.{ColonnadeConfig, ShellConfig}
import colonnade.formats.{Manifest, RecordFormats}
import colonnade.refit.BentMesh
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** The device in its shell, with fake path tracers and a memory of random latency. */
class ColonnadeAxiSpec extends AnyFlatSpec with OneSimulation {
  behavior of "ColonnadeAxi"

  private val config: ColonnadeConfig = TestConfigs.tiny.copy(
    array = TestConfigs.tiny.array.copy(rows = 2, columns = 2),
    columnBvhMemory = TestConfigs.tiny.columnBvhMemory.copy(depth = 64),
    frame = TestConfigs.tiny.frame.copy(tileSize = 4)
  )
  private val shell   = ShellConfig(16, 4)
  private val bending = ShellConfig(16, 4, refit = true)
  private val (w, h)  = (13, 6)
  private val stride  = 64
  private val pixels  = BigInt(0x40000)
  private val window  = (pixels, pixels + stride * h)
  private val other   = BigInt(0x50000)
  private val allDone = Set("frameDone")

  private def records(seed: Int): Seq[BigInt] = {
    val random = new Random(seed)
    Seq.fill(config.columnBvhMemory.depth)(BigInt(new RecordFormats(config).recordBits, random))
  }

  private def onBench(seed: Int)(body: ShellBench => Unit)(dut: ColonnadeAxi): Unit =
    body(new ShellBench(dut, config, shell, new Random(seed)))

  private def expectPicture(bench: ShellBench, scene: Seq[BigInt]): Unit = {
    for (y <- 0 until h; x <- 0 until w) {
      val green = SrgbEncoder(FakePathTracer.colour(config, scene, x, y))
      assert(bench.memory.dump(pixels + stride * y + 4 * x, 4) == Seq(0, green, 0, 255), s"pixel $x, $y")
    }
    assert(bench.memory.written.size == 4 * w * h)
    bench.memory.written.clear()
  }

  private def registers(bench: ShellBench): Unit = {
    val host = bench.host
    assert(host("identity") == BigInt("434c4e44", 16) && host("version") == ShellMap.version)
    val hash = (0 until 8).map(i => f"${host(s"formatHash[$i]")}%08x").mkString
    assert(hash == Manifest(config)("formatHash").str)
    assert(host("frameSize") == (480 << 16 | 640) && host("capabilities") == (4 << 8 | 4))
    for (unknown <- Seq(0x3c, 0x108, 0x7ffc, 0xfffc)) {
      assert(host.read(unknown) == ((BigInt(0), false)))
      assert(!host.write(unknown, 1))
    }
    assert(!host.write(0, 1) && !host.write(0x44, 1)) // read only
    assert(!host.read(0x40)._2)                       // write only
    assert(!host.write(0x80, 64, strobes = 7) && host("framebuffer.base") == 0)
    assert(!host.write(0x9c, 4) && !host.write(0x84, 256)) // too wide
    assert(!host.write(ShellMap.deviceBase, 1))            // the shell starts frames
    assert(!host.write(ShellMap.deviceBase + 4, 1))        // status.busy
    assert(!host.write(0x40, 3))                           // two commands
    assert(!host.write(0x100, 1))                          // no pixel stream
    assert(!host.write(0x4c, 8))                           // no unit that refits
    bench.write("lights[0].position.x", 0x12345678)
    assert(bench.read("lights[0].position.x") == 0x12345678)
    assert(host("status") == 0)

    // A level interrupt, while an enabled status bit is set
    host.set("interrupt.test", 5)
    assert(!bench.interrupt && host("interrupt.status") == 5)
    host.set("interrupt.enable", 2)
    assert(!bench.interrupt)
    host.set("interrupt.enable", 4)
    assert(bench.interrupt)
    host.set("interrupt.status", 4)
    assert(!bench.interrupt && host("interrupt.status") == 1)
  }

  private def loadsAndFrames(bench: ShellBench): Unit = {
    bench.size(w, h)
    for (seed <- 0 until 3) {
      val scene = records(seed)
      assert(bench.load(bench.image(scene)).isEmpty)
      bench.framebuffer(pixels, stride, 0, window)
      bench.host.set("control", 1)
      assert(bench.until("frameDone") == allDone)
      assert(bench.framebufferErrors.isEmpty && bench.read("status.done") == 1)
      expectPicture(bench, scene)
    }

    // A refused image is named, and nothing of it is loaded
    val scene = records(1)
    val good  = bench.image(scene)
    assert(bench.load(good).isEmpty)
    val bytes = 4 * good.size
    val other = bench.image(records(2))
    assert(bench.load(other.updated(5, other(5) ^ 1)) == Set("formatHash"))
    assert(bench.load(other.updated(0, BigInt(0))) == Set("magic"))
    assert(bench.load(other.updated(3, BigInt(bytes + 128))) == Set("length"))
    assert(bench.load(other.updated(32, BigInt(1))) == Set("section"))
    assert(bench.load(other.updated(33, BigInt(65))) == Set("section"))
    assert(bench.load(other, at = 0x10020) == Set("alignment"))
    bench.memory.read.clear()
    assert(bench.load(other, window = Some((0x10000, 0x10000 + bytes - 1))) == Set("window"))
    assert(bench.load(other, window = Some((0x10080, 0x20000))) == Set("window"))
    assert(bench.load(Nil) == Set("length"))
    assert(bench.memory.read.isEmpty)
    bench.memory.response = address => if (address == 0x10000) 2 else 0
    assert(bench.load(other) == Set("response"))
    bench.memory.response = _ => 0
    bench.host.set("control", 1)
    bench.until("frameDone")
    expectPicture(bench, scene) // the scene is still that of the good image

    // Errors after the header: some records are loaded, nothing is read beyond the image
    assert(bench.load(other.updated(12, BigInt(9))) == Set("length"))
    assert(bench.load(other.updated(12, BigInt(0))) == Set("length"))
    bench.memory.response = address => if (address > 0x10200) 3 else 0
    assert(bench.load(other) == Set("response"))
    bench.memory.response = _ => 0
    assert(bench.memory.read.forall(address => address >= 0x10000 && address < 0x10000 + bytes))
    assert(bench.load(good).isEmpty)
  }

  private def errorsAndResets(bench: ShellBench): Unit = {
    val scene = records(1)
    bench.size(w, h)
    assert(bench.load(bench.image(scene)).isEmpty)
    for (
      ((base, step, format), error) <- Seq(
        ((pixels + 8, stride, 0), "alignment"),
        ((pixels, stride + 8, 0), "alignment"),
        ((pixels, stride, 3), "format")
      )
    ) {
      bench.framebuffer(base, step, format, window)
      bench.host.set("control", 1)
      assert(bench.until("frameDone") == Set("frameDone", "error") && bench.framebufferErrors == Set(error))
    }
    bench.framebuffer(pixels, stride, 0, (pixels, pixels + stride * h - 1))
    bench.host.set("control", 1)
    assert(bench.until("frameDone") == Set("frameDone", "error") && bench.framebufferErrors == Set("window"))
    assert(bench.memory.written.forall(address => address >= pixels && address < pixels + stride * (h - 1) + 48))
    bench.framebuffer(pixels + 8, stride, 0, window)
    bench.host.set("control", 1)
    assert(bench.until("frameDone") == Set("frameDone", "error") && bench.framebufferErrors == Set("alignment"))
    bench.framebuffer(pixels, stride, 0, window)
    bench.memory.response = _ => 2
    bench.host.set("control", 1)
    assert(bench.until("frameDone") == Set("frameDone", "error") && bench.framebufferErrors == Set("response"))
    bench.memory.response = _ => 0
    bench.memory.written.clear()
    bench.host.set("control", 1)
    assert(bench.until("frameDone") == allDone && bench.framebufferErrors.isEmpty)
    expectPicture(bench, scene)

    // The next frame is written while one runs, and starts after it
    bench.memory.maxDelay = 200
    bench.framebuffer(pixels, stride, 0, (pixels, pixels + stride * h - 1))
    bench.host.set("control", 1)
    bench.size(w - 4, h)
    assert(bench.read("frame.width") == w)
    bench.framebuffer(other, stride, 1, (other, other + stride * h))
    bench.host.set("control", 1)
    assert(bench.host("status") == 3)
    assert(!bench.host.write(0x40, 1) && !bench.host.write(ShellMap.deviceBase + 400, 1) && !bench.host.write(0x80, 0))
    assert(bench.until("frameDone") == Set("frameDone", "error") && bench.framebufferErrors == Set("window"))
    assert(bench.host("status") == 1)
    val first = bench.memory.written.filter(_ < other)
    assert(first.size == 4 * w * (h - 1) + 48)
    assert(bench.until("frameDone") == allDone && bench.framebufferErrors.isEmpty)
    assert(bench.memory.written.size - first.size == 2 * (w - 4) * h && bench.host("status") == 0)
    bench.memory.maxDelay = 20
    bench.memory.written.clear()

    // A soft reset recovers from any state
    val host = bench.host
    for (delay <- Seq(0, 3, 20, 45, 90, 150, 260); isLoad <- Seq(false, true)) {
      bench.size(w, h)
      assert(bench.load(bench.image(scene)).isEmpty)
      bench.framebuffer(pixels, stride, 0, window)
      bench.memory.isSilent = delay == 90
      host.set("control", if (isLoad) 2 else 1)
      for (_ <- 0 until delay) bench.cycle()
      host.set("control", 4)
      if (delay == 90) assert(host("status") == 8) // it waits for the bus
      bench.memory.isSilent = false
      while (host("status") != 0) bench.cycle()
      assert(bench.memory.isIdle)
      assert(bench.read("frame.width") == 0 && bench.framebufferErrors.isEmpty && host("image.errors") == 0)
      host.set("interrupt.status", 7)
    }
    bench.memory.written.clear()
    bench.size(w, h)
    assert(bench.load(bench.image(scene)).isEmpty)
    host.set("control", 1)
    assert(bench.until("frameDone") == allDone)
    expectPicture(bench, scene)
  }

  private def refits(dut: ColonnadeAxi): Unit = {
    val bench          = new ShellBench(dut, config, bending, new Random(7))
    val (host, memory) = (bench.host, bench.refits.get)
    val mesh           = BentMesh(config, bench.random, 4, 3000, 3, 1)
    def run(): Unit    = {
      mesh.store(memory)
      for ((name, value) <- mesh.settings) host.set(s"refit.$name", value)
      host.set("refit.control", 1)
    }
    def ends(errors: Int): Unit = {
      assert(bench.until("refitDone") == Set("refitDone"))
      assert(host("refit.status") == 0 && host("refit.errors") == errors)
      for (_ <- 0 until 20) bench.cycle()
      assert(host("interrupt.status") == 0, "a refit ends once")
    }
    assert(host("capabilities") == (4 << 8 | 4 | 64) && host("refit.status") == 0)
    memory.isSilent = true
    run()
    assert(host("refit.status") == 1 && !host.write(0x120, 1) && !host.write(0x150, 0))
    assert(host("interrupt.status") == 0)
    memory.isSilent = false
    ends(errors = 0)
    assert(mesh.wrong(memory) == Nil && host("refit.flatPairs") == mesh.flatPairs)
    assert((0 until 6).map(i => host(s"refit.bounds[$i]")) == mesh.bounds)

    // One that is refused ends, and one whose plan is wrong
    for ((name, value, errors) <- Seq(("refit.plan", 32, 1), ("refit.lines", 0, 4))) {
      host.set(name, value)
      host.set("refit.control", 1)
      ends(errors)
      run()
      ends(errors = 0)
    }

    // A soft reset ends its bursts, and is no end of a refit
    for (cycles <- Seq(10, 40, 90, 200)) {
      run()
      for (_ <- 0 until cycles) bench.cycle()
      host.set("control", 4)
      while (host("status") != 0) {}
      assert(memory.isIdle && host("refit.status") == 0 && host("interrupt.status") == 0)
    }
    run()
    ends(errors = 0)
    assert(mesh.wrong(memory) == Nil && memory.written.size == 32 * mesh.records.size)
  }

  inOneSimulation(new ColonnadeAxi(config, bending, new FakePathTracer(_)))(
    "bend meshes beside the device, and end the bursts of a refit in a soft reset" -> refits
  )

  inOneSimulation(new ColonnadeAxi(config, shell, new FakePathTracer(_)))(
    "identify itself, refuse accesses that mean nothing, and interrupt while an enabled status bit is set" ->
      onBench(1)(registers),
    "load images and write frames, one after the other, and refuse images by name" ->
      onBench(3)(loadsAndFrames),
    "refuse a misaligned framebuffer, end a frame whose writes fail, and recover by a soft reset" ->
      onBench(5)(errorsAndResets)
  )
}
