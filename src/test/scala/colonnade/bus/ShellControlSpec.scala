package colonnade.bus

import chisel3._
import chiseltest._
import colonnade.config.{ColonnadeConfig, ShellConfig}
import colonnade.{Packed, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.collection.mutable
import scala.util.Random

class ShellControlSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "ShellControl"

  for (pixelStream <- Seq(false, true))
    it should s"run each frame and each load once, with its own settings, and end them by a reset, stream $pixelStream" in {
      val (config, shell) = (TestConfigs.tiny, ShellConfig(16, 4, pixelStream))
      test(new ShellControlHarness(config, shell)) { dut =>
        val bench = new ShellControlBench(dut, config.frame.tileSize, shell, new Random(3))
        for (_ <- 0 until 4000) bench.step()
        val counts = Seq(bench.frames, bench.refused, bench.queued, bench.loads, bench.resets)
        assert(counts.forall(_ > 10), s"frames, refused, queued, loads and resets: $counts")
      }
    }

  behavior of "InterruptController"

  it should "keep an event until it is cleared, also one in the cycle of the clear, and interrupt while it is enabled" in
    test(new InterruptController(Interrupts.names.size)) { dut =>
      val random        = new Random(4)
      var status, level = 0
      for (_ <- 0 until 2000) {
        val Seq(events, clear, set, enable) = Seq(dut.io.events, dut.io.clear, dut.io.test, dut.io.enable).map { port =>
          val bits = if (random.nextBoolean()) 0 else random.nextInt(1 << Interrupts.names.size)
          port.poke(bits)
          bits
        }
        dut.io.status.expect(status)
        dut.io.interrupt.expect(level != 0)
        dut.clock.step()
        level = status & enable
        status = (status & ~clear) | events | set
      }
    }
}

/** Packs settings and errors into one port each. */
private class ShellControlHarness(config: ColonnadeConfig, shell: ShellConfig) extends Module {
  private val control = Module(new ShellControl(config, shell)).io

  val io          = IO(chiselTypeOf(control))
  val settings    = IO(Input(UInt(control.settings.getWidth.W)))
  val framebuffer = IO(Output(UInt(control.framebuffer.getWidth.W)))
  val errors      = IO(Output(UInt(control.errors.getWidth.W)))
  io :<>= control
  control.settings := settings.asTypeOf(control.settings)
  framebuffer      := control.framebuffer.asUInt
  errors           := control.errors.asUInt
}

/** A host that writes registers as [[ShellRegisters]] lets it, and a device, a writer, a loader and a bus of random
  * speed. A reference follows the frame or load that runs.
  */
private class ShellControlBench(dut: ShellControlHarness, tileSize: Int, shell: ShellConfig, random: Random) {
  private val (port, layout) = (dut.io, new Packed(new FramebufferSettings))

  /** Frames that have ended, that were refused, and that waited for another one; loads that have ended; resets. */
  var frames, refused, queued, loads, resets = 0

  // The host
  private var current  = BigInt(0)
  private val expected = mutable.Queue.empty[BigInt] // settings of frames that have not begun
  private var command  = ""
  private var pause    = 0

  // What runs
  private var running                     = Option.empty[BigInt]
  private var isDone, isLoading, isResets = false // the device has ended the frame
  private var begins                      = false
  private var resetFor                    = 0     // cycles of the reset
  private var lastErrors                  = Set.empty[String]

  // What is around: cycles until it is idle; the loader is idle in its first cycle, too
  private var device, writer, loader = 0
  private var loadFails              = false
  private var writerErrors           = Set.empty[String]

  dut.clock.setTimeout(0)
  change()

  private def chance(times: Int): Boolean = random.nextInt(times) == 0

  /** New settings; most bases and strides are multiples of a row. */
  private def change(): Unit = {
    val any =
      layout.unpack(BigInt(layout.width, random)) + ("format" -> BigInt(random.nextInt(if (chance(6)) 4 else 3)))
    val fixed = Seq("base", "stride").flatMap { name =>
      Seq(name -> rowBytes(any), s"photo.$name" -> 4 * tileSize)
    }.map { case (name, row) => name -> (any(name) / row * row + (if (chance(12)) row / 2 else 0)) }
    current = layout.pack(any ++ fixed)
  }

  private def rowBytes(fields: Map[String, BigInt]): Int = tileSize * Seq(4, 2, 8, 4)(fields("format").toInt)

  /** Why a frame is refused. */
  private def faults(settings: BigInt): Set[String] = {
    val fields                                 = layout.unpack(settings)
    def isMisaligned(prefix: String, row: Int) = Seq("base", "stride").exists(name => fields(prefix + name) % row != 0)
    val ofPixels = !(shell.pixelStream && fields("toStream") == 1) && isMisaligned("", rowBytes(fields))
    val ofPhoto  = fields("photo.isEnabled") == 1 && isMisaligned("photo.", 4 * tileSize)
    Seq("format" -> (fields("format") == 3), "alignment" -> (ofPixels || ofPhoto)).collect { case (name, true) =>
      name
    }.toSet
  }

  def step(): Unit = {
    val (writesAreDone, busIsIdle) = (chance(2), chance(4))
    val loaderIsIdle               = !isLoading || loader == 0
    dut.settings.poke(current)
    port.commands.start.poke(command == "start")
    port.commands.load.poke(command == "load")
    port.commands.reset.poke(command == "reset")
    port.writesAreDone.poke(writesAreDone)
    port.deviceDone.poke(device == 0)
    port.writerIsIdle.poke(writer == 0)
    for ((name, error) <- port.writerErrors.elements) error.asInstanceOf[Bool].poke(writerErrors(name))
    port.loaderIsIdle.poke(loaderIsIdle)
    port.loadError.poke(loadFails)
    port.busIsIdle.poke(busIsIdle)

    // A frame begins, or is refused
    port.clearErrors.expect(begins)
    val fault = if (begins) faults(expected.head) else Set.empty[String]
    if (begins) running = Some(expected.dequeue())
    port.start.expect(begins && fault.isEmpty)
    running.foreach(settings => dut.framebuffer.expect(settings, "the settings of the frame"))
    assert(names(dut.errors) == lastErrors)

    // The state, and what ends in this cycle
    val flushes   = running.nonEmpty && isDone && !begins
    val frameEnds = (begins && fault.nonEmpty) || (flushes && writer == 0)
    val loadEnds  = isLoading && loader == 0
    val error     = if (loadEnds) loadFails else frameEnds && (fault ++ (if (begins) Nil else writerErrors)).nonEmpty
    port.flush.expect(flushes)
    port.load.expect(command == "load")
    port.events.expect(Seq(frameEnds, loadEnds, error).zipWithIndex.collect { case (true, bit) => 1 << bit }.sum)
    port.status.isRunning.expect(running.nonEmpty)
    port.status.isQueued.expect(expected.nonEmpty)
    port.status.isLoading.expect(isLoading)
    port.status.isResetting.expect(isResets)
    port.reset.expect(isResets)
    val resetEnds = isResets && resetFor > ShellControl.resetCycles && busIsIdle
    port.resetNext.expect(command == "reset" || (isResets && !resetEnds))

    val isIdle    = running.isEmpty && !isLoading && !isResets
    val nextWrite = write(isIdle && expected.isEmpty)
    dut.clock.step()
    follow(fault, frameEnds, loadEnds, resetEnds, isIdle && writesAreDone)
    command = nextWrite
  }

  /** The host's next command, or none: it arrives in the next cycle, and another write some cycles later. */
  private def write(isIdle: Boolean): String = {
    pause = (pause - 1).max(0)
    val canChange = expected.isEmpty && !isResets
    val next      = if (pause > 0) ""
    else if (chance(60)) "reset"
    else if (canChange && !isLoading && chance(4)) "start"
    else if (isIdle && chance(6)) "load"
    else ""
    if (next.isEmpty && pause == 0 && canChange && chance(4)) change()
    if (next.nonEmpty) pause = 4
    if (next == "start" && running.nonEmpty) queued += 1
    next
  }

  /** What the next cycle begins with. */
  private def follow(
      fault:     Set[String],
      frameEnds: Boolean,
      loadEnds:  Boolean,
      resetEnds: Boolean,
      mayBegin:  Boolean
  ): Unit = {
    val started = begins && fault.isEmpty
    if (frameEnds) {
      lastErrors = if (begins) fault else writerErrors
      if (begins) refused += 1 else frames += 1
      running = None
    }
    if (loadEnds) loads += 1
    isDone = running.nonEmpty && !started && (isDone || device == 0)
    if (isDone) writer = (writer - 1).max(0)
    device = if (started) 1 + random.nextInt(30) else (device - 1).max(0)
    if (begins) {
      writer = random.nextInt(12)
      writerErrors = Set()
    } else if (running.nonEmpty && chance(90))
      writerErrors += random.shuffle(port.writerErrors.elements.keys.toSeq).head
    loader = (loader - 1).max(0)
    isLoading &&= !loadEnds
    resetFor += 1
    isResets &&= !resetEnds
    if (command == "start") expected.enqueue(current)
    if (command == "load") {
      isLoading = true
      loader = 1 + random.nextInt(20)
      loadFails = chance(3)
    }
    begins = mayBegin && expected.nonEmpty && !begins
    if (command == "reset") {
      resets += 1
      expected.clear()
      running = None
      lastErrors = Set()
      isLoading = false
      begins = false
      isResets = true
      resetFor = 1
    }
  }

  private def names(errors: UInt): Set[String] =
    new Packed(new FramebufferError).unpack(errors.peekInt()).collect { case (name, bit) if bit == 1 => name }.toSet
}
