package colonnade.bus

import chisel3.{assert => _, _}
import chiseltest._
import colonnade.{OneSimulation, Simulation, TestConfigs}
import colonnade.axi.{AxiMemory, AxiPins, WriteOrder}
import colonnade.config.{ColonnadeConfig, ShellConfig}
import colonnade.formats.Pixel
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** The writer behind its guard. */
private class GuardedWriter(config: ColonnadeConfig, shell: ShellConfig) extends Module {
  val settings      = IO(Input(new FramebufferSettings))
  val pixels        = IO(Vec(config.array.columns, Flipped(chisel3.util.Decoupled(new Pixel(config)))))
  val start         = IO(Input(Bool()))
  val flush         = IO(Input(Bool()))
  val isIdle        = IO(Output(Bool()))
  val windowError   = IO(Output(Bool()))
  val responseError = IO(Output(Bool()))
  val pins          = IO(AxiPins.readsAndWrites(BurstWriter.idBits, shell.busBytes)).suggestName("m_axi")

  /** The guard ends its bursts; the writer is reset. */
  val abandon     = IO(Input(Bool()))
  val clears      = IO(Input(Bool()))
  val guardIsIdle = IO(Output(Bool()))

  private val writer = withReset(reset.asBool || clears)(Module(new FramebufferWriter(config, shell)))
  private val guard  = Module(new AxiWriteGuard(BurstWriter.idBits, shell.busBytes))
  writer.io.settings    := settings
  writer.io.clearErrors := start
  writer.io.flush       := flush
  writer.io.pixels.zip(pixels).foreach { case (sink, source) => sink :<>= source }
  isIdle        := writer.io.isIdle && guard.io.isIdle
  windowError   := writer.io.errors.window
  responseError := writer.io.errors.response
  guard.io.inner :<>= writer.io.axi
  guard.io.abandon := abandon
  guardIsIdle      := guard.io.isIdle
  Seq("aw" -> guard.io.axi.aw, "w" -> guard.io.axi.w).foreach { case (channel, stream) => pins.drive(channel, stream) }
  pins.receive("b", guard.io.axi.b)
  for ((name, pin) <- pins.elements if name.startsWith("ar") && name != "arready" || name == "rready")
    pin := 0.U.asTypeOf(pin)
}

/** A pixel of a test. */
private final case class Shot(x: Int, y: Int, r: Int, g: Int, b: Int, isObject: Boolean)

class FramebufferWriterSpec extends AnyFlatSpec with OneSimulation {
  behavior of "FramebufferWriter"

  private def encoded(shot: Shot, format: Int): Seq[Int] = {
    def low(value: Int, bytes: Int) = Seq.tabulate(bytes)(byte => (value >> (8 * byte)) & 255)
    val Seq(r, g, b)                = Seq(shot.r, shot.g, shot.b).map(SrgbEncoder(_))
    format match {
      case 0 => Seq(b, g, r, 255)
      case 1 => low((r >> 3) << 11 | (g >> 2) << 5 | b >> 3, 2)
      case 2 =>
        Seq(shot.r, shot.g, shot.b).flatMap(v => low(v << 4 | v >> 8, 2)) ++ low(if (shot.isObject) 65535 else 0, 2)
    }
  }

  private class Bench(
      dut:        GuardedWriter,
      config:     ColonnadeConfig,
      shell:      ShellConfig,
      val random: Random,
      order:      WriteOrder.Value = WriteOrder.any
  ) {
    val memory = new AxiMemory(dut.pins, shell.busBytes, random, order = order)
    val tile   = config.frame.tileSize
    dut.clock.setTimeout(0)
    dut.pixels.foreach(_.valid.poke(false))

    def cycle(): Unit = { memory.cycle(); dut.clock.step() }

    def shots(width: Int, height: Int): Seq[Shot] = for (y <- 0 until height; x <- 0 until width)
      yield Shot(x, y, random.nextInt(4096), random.nextInt(4096), random.nextInt(4096), random.nextBoolean())

    /** Pixels tile by tile, mixed within and between neighbouring tiles. */
    def mixed(shots: Seq[Shot]): Seq[Shot] =
      shots.groupBy(shot => (shot.y / tile, shot.x / tile)).toSeq.sortBy(_._1).flatMap(of => random.shuffle(of._2))
        .zipWithIndex.map { case (shot, index) => (index + random.nextInt(tile * tile), shot) }.sortBy(_._1).map(_._2)

    def settings(base: BigInt, stride: Int, format: Int, window: (BigInt, BigInt)): Unit = {
      dut.settings.base.poke(base)
      dut.settings.stride.poke(stride)
      dut.settings.format.poke(format)
      dut.settings.window.base.poke(window._1)
      dut.settings.window.end.poke(window._2)
    }

    /** Ends the guard's bursts in the middle of a frame; the master is reset meanwhile. */
    def abandon(cycles: Int): Unit = {
      def offer(isValid: Boolean): Unit = dut.pixels.zipWithIndex.foreach { case (port, index) =>
        port.valid.poke(isValid)
        port.bits.x.poke(index)
        port.bits.y.poke(random.nextInt(16))
      }
      for (_ <- 0 until cycles) { offer(random.nextBoolean()); cycle() }
      offer(false)
      dut.abandon.poke(true)
      cycle()
      dut.clears.poke(true)
      cycle()
      dut.clears.poke(false)
      var waited = 0
      while (!dut.guardIsIdle.peekBoolean()) {
        cycle()
        waited += 1
        assert(waited < 20000, "a reset does not end")
      }
      assert(memory.isIdle)
      dut.abandon.poke(false)
    }

    def frame(shots: Seq[Shot]): Unit = {
      dut.start.poke(true)
      cycle()
      dut.start.poke(false)
      val queues =
        dut.pixels.indices.map(i => shots.zipWithIndex.filter(_._2 % dut.pixels.size == i).map(_._1).iterator)
      var left = shots.size
      val now  = Array.fill[Option[Shot]](dut.pixels.size)(None)
      while (left > 0) {
        for ((port, index) <- dut.pixels.zipWithIndex) {
          if (now(index).isEmpty && queues(index).hasNext && random.nextInt(4) > 0)
            now(index) = Some(queues(index).next())
          port.valid.poke(now(index).nonEmpty)
          for (shot <- now(index)) {
            port.bits.x.poke(shot.x)
            port.bits.y.poke(shot.y)
            port.bits.colour.r.poke(shot.r)
            port.bits.colour.g.poke(shot.g)
            port.bits.colour.b.poke(shot.b)
            port.bits.isObject.poke(shot.isObject)
          }
        }
        for ((port, index) <- dut.pixels.zipWithIndex if now(index).nonEmpty && port.ready.peekBoolean()) {
          now(index) = None
          left -= 1
        }
        cycle()
      }
      dut.pixels.foreach(_.valid.poke(false))
      dut.flush.poke(true)
      var cycles = 0
      while (!dut.isIdle.peekBoolean()) {
        cycle()
        cycles += 1
        assert(cycles < 20000)
      }
      assert(memory.isIdle) // all writes are answered
      dut.flush.poke(false)
    }
  }

  private def config(columns: Int, tileSize: Int) = TestConfigs.tiny.copy(
    array = TestConfigs.tiny.array.copy(columns = columns),
    frame = TestConfigs.tiny.frame.copy(tileSize = tileSize, hits = false)
  )

  for ((bus, columns, tile, rows) <- Seq((4, 1, 8, 4), (16, 2, 8, 16), (128, 1, 16, 2)))
    it should s"write all formats over $bus bytes from $columns columns of tiles of $tile with $rows rows" in {
      val (configuration, shell) = (config(columns, tile), ShellConfig(bus, rows))
      test(new GuardedWriter(configuration, shell)).withAnnotations(Simulation.verilator) { dut =>
        val bench = new Bench(dut, configuration, shell, new Random(bus))
        for (format <- 0 to 2) {
          val bytes  = Seq(4, 2, 8)(format)
          val stride = 3 * tile * bytes
          val base   = BigInt(0x1200000000L) + 7 * stride
          val height = 2 * tile - 1
          bench.settings(base, stride, format, (base, base + stride * height))
          val shots = bench.shots(2 * tile + 1, height)
          bench.memory.written.clear()
          bench.frame(bench.mixed(shots))
          for (shot <- shots) {
            val address = base + shot.y * stride + shot.x * bytes
            assert(bench.memory.dump(address, bytes) == encoded(shot, format), s"$shot in format $format")
          }
          assert(bench.memory.written.size == shots.size * bytes)
          assert(!dut.windowError.peekBoolean() && !dut.responseError.peekBoolean())
        }
      }
    }

  private val (pair, narrow, wide) = (config(2, 8), ShellConfig(8), ShellConfig(16))

  inOneSimulation(new GuardedWriter(pair, narrow))(WriteOrder.values.toSeq.map { order =>
    s"write to a memory that takes addresses and data in the order $order, and end abandoned bursts" ->
      { dut: GuardedWriter =>
        val bench = new Bench(dut, pair, narrow, new Random(order.id), order)
        bench.settings(0x1000, 64, 0, (0x1000, 0x1000 + 64 * 24))
        val shots = bench.shots(16, 24)
        bench.frame(bench.mixed(shots))
        for (shot <- shots) assert(bench.memory.dump(0x1000 + 64 * shot.y + 4 * shot.x, 4) == encoded(shot, 0))
        for (_ <- 0 until 20) bench.abandon(bench.random.nextInt(60))
      }
  }: _*)

  it should "write whole rows as bursts when pixels come tile by tile" in {
    val (configuration, shell) = (config(1, 8), ShellConfig(8))
    test(new GuardedWriter(configuration, shell)).withAnnotations(Simulation.verilator) { dut =>
      val bench = new Bench(dut, configuration, shell, new Random(3))
      bench.settings(0, 64, 0, (0, 4096))
      bench.frame(bench.shots(16, 8).sortBy(shot => (shot.x / 8, shot.y % 2, shot.x)))
      assert(bench.memory.bursts == Seq.fill(16)(4))
    }
  }

  inOneSimulation(new GuardedWriter(pair, wide))(
    "write nothing outside the window, report it, and forget it with the next frame" -> { dut =>
      val bench = new Bench(dut, pair, wide, new Random(4))
      val shots = bench.shots(16, 12)
      for ((first, last) <- Seq((2, 12), (0, 9), (3, 3))) {
        bench.memory.written.clear()
        bench.settings(0x8000, 64, 0, (0x8000 + 64 * first, 0x8000 + 64 * last))
        bench.frame(bench.mixed(shots))
        val inside = for (y <- first until last; i <- 0 until 64) yield BigInt(0x8000 + 64 * y + i)
        assert(bench.memory.written == inside.toSet)
        assert(dut.windowError.peekBoolean())
      }
      bench.settings(0x8000, 64, 0, (0, 0x10000))
      bench.frame(bench.mixed(shots))
      assert(!dut.windowError.peekBoolean())
    },
    "stop writing after an error, report it, and write the next frame" -> { dut =>
      val bench = new Bench(dut, pair, wide, new Random(5))
      for (code <- Seq(2, 3)) {
        bench.settings(0, 64, 0, (0, 0x10000))
        bench.memory.response = address => if (address == 64 * 3) code else 0
        bench.memory.bursts.clear()
        bench.frame(bench.mixed(bench.shots(16, 64)))
        assert(dut.responseError.peekBoolean())
        assert(bench.memory.bursts.size < 2 * 64)
        bench.memory.response = _ => 0
        bench.memory.written.clear()
        bench.frame(bench.mixed(bench.shots(16, 16)))
        assert(!dut.responseError.peekBoolean() && bench.memory.written.size == 16 * 64)
      }
    }
  )
}
