package colonnade.unit

import chisel3._
import chisel3.util.{Decoupled, DecoupledIO, Valid}
import chiseltest._
import colonnade.TestParts._
import colonnade.config.{ColonnadeConfig, PathConfig}
import colonnade.formats.{FrameRegisters, Pixel, RecordBroadcast}
import colonnade.ray.PreparedRay
import colonnade.shading.Occlusion
import colonnade.{Matrix, Packed, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.collection.mutable
import scala.util.Random

/** A path unit with the tables of its hits; what its rays meet is found outside. */
private class PathUnitHarness(config: ColonnadeConfig) extends Module {
  private val unit = Module(new PathUnit(config)).io
  private val hits = Module(new PathHits(config)).io

  val registers  = IO(Input(UInt(new FrameRegisters(config).getWidth.W)))
  val start      = IO(Input(Bool()))
  val positions  = IO(chiselTypeOf(unit.positions))
  val pixels     = IO(chiselTypeOf(unit.pixels))
  val pixel      = IO(Output(UInt(new Pixel(config).getWidth.W)))
  val rays       = IO(Decoupled(UInt(hits.rays.bits.getWidth.W)))
  val results    = IO(Flipped(Valid(UInt(hits.results.bits.getWidth.W))))
  val requests   = IO(chiselTypeOf(hits.requests))
  val broadcasts = IO(Flipped(Vec(config.columnBvhMemory.banks, Valid(new RecordBroadcast(config)))))
  val isIdle     = IO(Output(Bool()))
  val events     = IO(chiselTypeOf(unit.events))

  unit.registers := registers.asTypeOf(unit.registers)
  unit.positions :<>= positions
  pixels :<>= unit.pixels
  pixel  := unit.pixels.bits.asUInt
  isIdle := unit.isIdle
  events := unit.events

  hits.trace :<>= unit.trace
  hits.start         := start
  hits.scene         := unit.registers.scene
  rays.valid         := hits.rays.valid
  rays.bits          := hits.rays.bits.asUInt
  hits.rays.ready    := rays.ready
  hits.results.valid := results.valid
  hits.results.bits  := results.bits.asTypeOf(hits.results.bits)
  requests :<>= hits.requests
  hits.broadcasts := broadcasts
  for ((wants, material) <- hits.wantsColours.toSeq.flatten.zip(unit.registers.materials))
    wants := material.hasCornerColours.getOrElse(false.B) || material.hasTexture.getOrElse(false.B)
}

/** A path unit gives each pixel once, equal to the model's, however long its rays are under way and whichever of them
  * ends first. `make test` has path units in path tracers.
  */
class PathUnitSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "PathUnit"

  private val tiny = TestConfigs.tiny

  private def follow(name: String, config: ColonnadeConfig): Unit =
    it should s"give each pixel once, equal to the model's: $name" taggedAs Matrix in
      test(new PathUnitHarness(config)).withAnnotations(Simulation.verilator) { dut =>
        dut.clock.setTimeout(0)
        for ((willing, seed, shadows) <- Seq((1.0, 1, true), (0.4, 2, true), (0.7, 3, false)))
          withClue(s"seed $seed: ") {
            val scene  = SmallFrame.scene(config, seed, shadows)
            val frame  = SmallFrame(config, scene)
            val random = new Random(seed)
            dut.registers.poke(new Packed(new FrameRegisters(config)).pack(frame.registers))
            dut.start.poke(true)
            dut.clock.step()
            dut.start.poke(false)
            dut.isIdle.expect(true)
            val records =
              new FakeRecords(config, Seq(dut.requests), config.array.rows, dut.broadcasts, frame.records, random)
            val tracing = new FakeTraversal(config, dut.rays, dut.results, new TriangleSearch(config, scene), random)
            val driver  = new PathDriver(config, dut.positions, dut.pixels, dut.pixel, dut.events, random)
            val pixels  = driver.run(frame, willing) {
              records.cycle(willing)
              tracing.cycle(willing)
            }(dut.clock.step())
            frame.check(pixels, driver.counts)
            frame.checkRays(driver.counts, shadows)
            assert(tracing.overtaken > 10, "rays overtake each other")
            dut.isIdle.expect(true)
          }
      }

  follow("eight paths, one after the other", tiny.copy(units = tiny.units.copy(pathContexts = 8)))
  follow(
    "many paths, pipelines, corner colours and emission", {
      val coloured = TestConfigs.withPipelines(TestConfigs.withColours.head)
      coloured.copy(units = coloured.units.copy(pathContexts = 24), frame = coloured.frame.copy(emission = true))
    }
  )
}

/** Answers rays in any order, with what a search through all triangles finds. */
private class FakeTraversal(
    config:  ColonnadeConfig,
    rays:    DecoupledIO[UInt],
    results: Valid[UInt],
    search:  TriangleSearch,
    random:  Random
) {
  import TriangleSearch.Fields

  private val (ray, result) =
    (new Packed(new PreparedRay(PathConfig(config))), new Packed(new TraceResult(PathConfig(config))))
  private val waiting = mutable.ArrayBuffer.empty[(Fields, Int)] // with the cycle from which on it may end
  private val known = mutable.Map.empty[BigInt, (Occlusion.Type, Option[Fields])] // by context
  private var now   = 0

  /** Rays that have ended before an older one. */
  var overtaken = 0

  def cycle(willing: Double): Unit = {
    val due  = waiting.indices.filter(waiting(_)._2 <= now)
    val next = Option.when(due.nonEmpty && random.nextDouble() < willing)(due(random.nextInt(due.size)))
    results.valid.poke(next.nonEmpty)
    for (index <- next) {
      val context = waiting(index)._1("context")
      if (!known.contains(context)) {
        val unknown = waiting.map(_._1).filterNot(ray => known.contains(ray("context"))).toSeq
        known ++= unknown.map(_("context")).zip(search.hits(unknown, search.triangles.map(_._2)))
      }
      val (occlusion, hit) = known.remove(context).get
      results.bits.poke(result.pack(
        Map("context" -> context, "hasHit" -> BigInt(hit.size), "occlusion" -> occlusion.litValue) ++
          hit.toSeq.flatten.map { case (name, value) => s"hit.$name" -> value }
      ))
      if (index > 0) overtaken += 1
      waiting.remove(index)
    }
    val accepts = random.nextDouble() < willing
    rays.ready.poke(accepts)
    if (accepts && rays.valid.peekBoolean())
      waiting.append((ray.unpack(rays.bits.peekInt()), now + 20 + random.nextInt(200)))
    now += 1
  }
}
