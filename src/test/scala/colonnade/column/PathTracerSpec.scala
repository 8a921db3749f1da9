package colonnade.column

import chisel3._
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameRegisters, Pixel}
import colonnade.unit.{FakeRecords, PathDriver, SmallFrame}
import colonnade.{Always, Matrix, Packed, Simulation, TestConfigs}
import org.scalatest.Tag
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** A path tracer gives each pixel once, equal to the model's, whenever records, positions and pixels move. */
class PathTracerSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "PathTracer"

  private def trace(name: String, config: ColonnadeConfig, tag: Tag = Always): Unit =
    it should s"give each pixel once, equal to the model's: $name" taggedAs tag in
      test(new PathTracerHarness(config)).withAnnotations(Simulation.verilator) { dut =>
        dut.clock.setTimeout(0)
        for ((willing, seed, shadows) <- Seq((0.3, 2, true), (1.0, 3, false)))
          withClue(s"seed $seed: ") {
            val frame  = SmallFrame(config, SmallFrame.scene(config, seed, shadows))
            val random = new Random(seed)
            dut.registers.poke(new Packed(new FrameRegisters(config)).pack(frame.registers))
            dut.io.start.poke(true)
            dut.clock.step()
            dut.io.start.poke(false)
            dut.io.isIdle.expect(true)
            val records = new FakeRecords(config, dut.io.requests, 0, dut.io.broadcasts, frame.records, random)
            val driver  =
              new PathDriver(config, dut.io.positions, dut.io.pixels, dut.pixel, dut.io.events.paths, random)
            val pixels = driver.run(frame, willing)(records.cycle(willing)) {
              for (unit <- dut.io.events.traversal) unit.intersector.stackOverflow.expect(false)
              dut.clock.step()
            }
            frame.check(pixels, driver.counts)
            frame.checkRays(driver.counts, shadows)
            dut.io.isIdle.expect(true)
          }
      }

  private val tiny = TestConfigs.tiny

  private def withRows(rows: Int, of: ColonnadeConfig = tiny): ColonnadeConfig =
    of.copy(array = of.array.copy(rows = rows), units = of.units.copy(pathContexts = 8))

  trace("two rows, a tree, snooping, eight paths", withRows(2))
  trace("timing slices", TestConfigs.withExtraSlices(withRows(1)), Matrix)
  trace("a shading pipeline", withRows(2, tiny.copy(units = tiny.units.copy(shadeInterval = 3))), Matrix)
  trace(
    "no tree, one context, one path, no snooping",
    TestConfigs.withPrecision(16, 16, 32).copy(
      array = tiny.array.copy(contexts = 1),
      geometry = tiny.geometry.copy(bvh = false),
      columnBvhMemory = tiny.columnBvhMemory.copy(snooping = false, banks = 1),
      frame = tiny.frame.copy(hits = false),
      units = tiny.units.copy(pathContexts = 1)
    ),
    Matrix
  )
  trace(
    "wide units", {
      val config = withRows(2)
      config.copy(
        units = config.units.copy(boxLanes = 4, triangleLanes = 2, triangleRows = 2),
        columnBvhMemory = config.columnBvhMemory.copy(recordBuffers = 3)
      )
    },
    Matrix
  )
  trace(
    "one light, no bounces",
    withRows(2, tiny.copy(frame = tiny.frame.copy(lights = 1, maxBounces = 0))),
    Matrix
  )
  for (config <- TestConfigs.withColours.tail) {
    val withoutTextures = config.copy(geometry = config.geometry.copy(textureBytes = 0))
    trace(s"corner colours at ${config.precision}", withRows(2, withoutTextures), Matrix)
  }
}

/** Packs registers and pixel into one port each. */
private class PathTracerHarness(config: ColonnadeConfig) extends Module {
  private val tracer = Module(new PathTracer(config))

  val registers = IO(Input(UInt(new FrameRegisters(config).getWidth.W)))
  val pixel     = IO(Output(UInt(new Pixel(config).getWidth.W)))
  val io        = IO(chiselTypeOf(tracer.io))
  io :<>= tracer.io
  tracer.io.registers := registers.asTypeOf(new FrameRegisters(config))
  pixel               := tracer.io.pixels.bits.asUInt
}
