package colonnade.bus

import chisel3.{assert => _, _}
import chiseltest._
import colonnade.{Always, Simulation, TestConfigs}
import colonnade.axi.{AxiMemory, AxiPins}
import colonnade.config.{ColonnadeConfig, ShellConfig}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** The compositor with its reads at pins. */
private class CompositorHarness(config: ColonnadeConfig, shell: ShellConfig) extends Module {
  private val compositor = Module(new PhotoCompositor(config, shell))

  val settings = IO(Input(new FramebufferSettings))
  val rows     = IO(chiselTypeOf(compositor.io.rows)).suggestName("rows")
  val out      = IO(chiselTypeOf(compositor.io.out)).suggestName("out")
  val status   = IO(Output(UInt(3.W)))
  val pins     = IO(AxiPins.reads(BurstWriter.idBits, shell.busBytes)).suggestName("m_axi")
  compositor.io.settings := settings
  compositor.io.rows :<>= rows
  out :<>= compositor.io.out
  pins.drive("ar", compositor.io.axi.ar)
  pins.receive("r", compositor.io.axi.r)
  status := compositor.io.isIdle ## compositor.io.isError ## compositor.io.isOutside
}

/** A row of a test, and the ratios of the pixels that show the photo. */
private final case class PhotoRow(tile: Int, y: Int, mask: BigInt, words: Seq[BigInt], ratios: Seq[Option[Seq[Int]]])

class PhotoCompositorSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "PhotoCompositor"

  private val one = 1 << 12 // the ratio 1

  private def packed(codes: Seq[Int], linear: Seq[Int], format: Int): BigInt = {
    val Seq(r, g, b) = codes.map(BigInt(_))
    format match {
      case 0 => BigInt(255) << 24 | r << 16 | g << 8 | b
      case 1 => (r >> 3) << 11 | (g >> 2) << 5 | b >> 3
      case 2 => BigInt(linear(2)) << 32 | BigInt(linear(1)) << 16 | linear.head
    }
  }

  private def shown(photo: Seq[Int], ratio: Seq[Int], strength: Int, format: Int): BigInt = {
    val linear = photo.zip(ratio).map { case (code, ratio) =>
      val mixed = (strength * ratio + (255 - strength) * one + 127) / 255
      ((SrgbEncoder.decoded(code, PhotoPixel.linearBits).toLong * mixed + one / 2) / one).min(65535).toInt
    }
    packed(linear.map(SrgbEncoder(_, PhotoPixel.linearBits)), linear, format)
  }

  private def photoAt(x:    Int, y: Int): Seq[Int] = Seq(7 * x + 31 * y, 13 * x + y * y, 251 * (x ^ y)).map(_ & 255)
  private def strengthAt(x: Int, y: Int): Int      = (37 * x + 101 * y + 255) & 255

  private class Bench(dut: CompositorHarness, config: ColonnadeConfig, shell: ShellConfig, random: Random) {
    val tile   = config.frame.tileSize
    val memory = new AxiMemory(dut.pins, shell.busBytes, random)
    val base   = BigInt(0x4300000000L)
    val stride = 4 * tile * 4
    var events = 0
    dut.clock.setTimeout(0)

    def settings(format: Int, first: Int, last: Int, hasStrengths: Boolean = false): Unit = {
      dut.settings.format.poke(format)
      dut.settings.photo.hasStrengths.poke(hasStrengths)
      dut.settings.photo.isEnabled.poke(true)
      dut.settings.photo.base.poke(base)
      dut.settings.photo.stride.poke(stride)
      dut.settings.photo.window.base.poke(base + first * stride)
      dut.settings.photo.window.end.poke(base + last * stride)
    }

    for (y <- 0 until 16; x <- 0 until 4 * tile) {
      val Seq(r, g, b) = photoAt(x, y)
      memory.store(base + y * stride + 4 * x, Seq(BigInt(strengthAt(x, y)) << 24 | r << 16 | g << 8 | b))
    }

    def row(format: Int): PhotoRow = {
      val share  = Seq(0.0, 0.5, 1.0)(random.nextInt(3))
      val ratios = Seq.fill(tile)(Option.when(random.nextDouble() < share)(Seq.fill(3)(
        if (random.nextBoolean()) one else random.nextInt(2 * one)
      )))
      val words = ratios.map {
        case Some(ratio) => ratio.zipWithIndex.map { case (r, i) => BigInt(r) << (13 * i) }.sum | BigInt(1) << 64
        case None        => BigInt(if (format == 2) 64 else 32, random)
      }
      PhotoRow(random.nextInt(4), random.nextInt(16), BigInt(tile, random), words, ratios)
    }

    /** Rows that have left, as tile, y, mask and words. */
    def run(rows: Seq[PhotoRow], accepts: Double): Seq[(Int, Int, BigInt, Seq[BigInt])] = {
      var left   = rows
      var taken  = Seq.empty[(Int, Int, BigInt, Seq[BigInt])]
      var holds  = false
      var cycles = 0
      while (taken.size < rows.size) {
        holds = left.nonEmpty && (holds || random.nextInt(3) > 0)
        dut.rows.valid.poke(holds)
        for (row <- left.headOption) {
          dut.rows.bits.tile.poke(row.tile)
          dut.rows.bits.y.poke(row.y)
          dut.rows.bits.mask.poke(row.mask)
          dut.rows.bits.pixels.zip(row.words).foreach { case (port, word) => port.poke(word) }
        }
        dut.out.ready.poke(random.nextDouble() < accepts)
        memory.cycle()
        events |= dut.status.peekInt().toInt & 3
        if (dut.out.valid.peekBoolean() && dut.out.ready.peekBoolean()) {
          val out = dut.out.bits
          taken :+= (
            (
              out.tile.peekInt().toInt,
              out.y.peekInt().toInt,
              out.mask.peekInt(),
              out.pixels.map(_.peekInt())
            )
          )
        }
        if (holds && dut.rows.ready.peekBoolean()) {
          left = left.tail
          holds = false
        }
        dut.clock.step()
        cycles += 1
        assert(cycles < 200 * rows.size + 500)
      }
      assert(dut.status.peekInt() >> 2 == 1, "idle at the end")
      taken
    }
  }

  private def config(tileSize: Int) = {
    val small = TestConfigs.withEnvironment(TestConfigs.environment)
    small.copy(frame = small.frame.copy(tileSize = tileSize, hits = false))
  }

  for ((bus, tile) <- Seq((4, 8), (16, 8), (16, 16), (128, 8)))
    it should s"put the photo into rows of $tile pixels over $bus bytes, whatever the timing" taggedAs
      Always.unless((bus, tile) == (16, 8) || tile == 16) in {
        val (configuration, shell) = (config(tile), ShellConfig(bus))
        test(new CompositorHarness(configuration, shell)).withAnnotations(Simulation.verilator) { dut =>
          val bench = new Bench(dut, configuration, shell, new Random(bus + tile))
          for ((format, accepts, hasStrengths) <- Seq((0, 1.0, true), (1, 0.5, false), (2, 0.3, true))) {
            bench.settings(format, 0, 16, hasStrengths)
            val rows = Seq.fill(20)(bench.row(format))
            for ((row, (x, y, mask, words)) <- rows.zip(bench.run(rows, accepts))) {
              assert((x, y, mask) == ((row.tile, row.y, row.mask)))
              for (i <- 0 until tile if mask.testBit(i)) {
                val (at, whole) = (tile * x + i, PhotoPixel.whole)
                val strength    = if (hasStrengths) strengthAt(at, y) else whole
                val expected    = row.ratios(i).fold(row.words(i))(shown(photoAt(at, y), _, strength, format))
                assert(words(i) == expected, s"pixel $i of $row in format $format")
              }
            }
            assert(bench.events == 0)
          }
        }
      }

  it should "read nothing outside the window, drop those pixels, and report them and failing reads" in {
    val (configuration, shell) = (config(8), ShellConfig(16))
    test(new CompositorHarness(configuration, shell)).withAnnotations(Simulation.verilator) { dut =>
      val bench = new Bench(dut, configuration, shell, new Random(9))
      bench.settings(0, 3, 9)
      val rows = Seq.fill(60)(bench.row(0))
      for ((row, (_, y, mask, _)) <- rows.zip(bench.run(rows, 0.7))) {
        val photo = row.ratios.zipWithIndex.collect { case (Some(_), i) => BigInt(1) << i }.sum
        assert(mask == (if (y >= 3 && y < 9) row.mask else row.mask & ~photo))
      }
      assert(bench.events == 1)
      assert(bench.memory.read.forall(at => at >= bench.base + 3 * bench.stride && at < bench.base + 9 * bench.stride))
      bench.events = 0
      bench.settings(0, 0, 16)
      bench.memory.response = _ => 2
      bench.run(Seq.fill(20)(bench.row(0)), 1)
      assert(bench.events == 2)
    }
  }

  it should "keep the photo's codes where no light is lost" in {
    for (code <- 0 to 255)
      assert(SrgbEncoder(SrgbEncoder.decoded(code, PhotoPixel.linearBits), PhotoPixel.linearBits) == code)
  }
}
