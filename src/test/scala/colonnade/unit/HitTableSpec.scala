package colonnade.unit

import chisel3._
import chiseltest._
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import colonnade.numbers.FixedPorts._
import colonnade.shading.Occlusion
import colonnade.{Always, Model, OneSimulation, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** The table equals a list of all results of a ray: the least (t, id) with t < tMax. */
class HitTableSpec extends AnyFlatSpec with OneSimulation {
  behavior of "HitTable"

  private def config(contexts: Int, format: ColonnadeConfig): ColonnadeConfig =
    format.copy(array = format.array.copy(contexts = contexts))

  for ((contexts, format) <- Seq((1, 0), (5, 2), (3, 4)))
    it should s"hold the least hit of $contexts contexts, format $format" taggedAs Always.unless(format == 2) in {
      val shape = config(contexts, TestConfigs.formats(format))
      test(new HitTable(shape)).withAnnotations(Simulation.verilator) { dut =>
        new HitTableDriver(dut, shape, seed = contexts).run(cycles = 300)
      }
    }

  it should "hold the least hit with extra slices" in {
    val shape = TestConfigs.withExtraSlices(config(contexts = 4, TestConfigs.formats.head))
    test(new HitTable(shape)).withAnnotations(Simulation.verilator) { dut =>
      new HitTableDriver(dut, shape, seed = 9).run(cycles = 300)
    }
  }

  private def driver(dut: HitTable) = new HitTableDriver(dut, TestConfigs.tiny, seed = 4)

  inOneSimulation(new HitTable(TestConfigs.tiny))(
    "hold the least hit"                                                            -> (driver(_).run(cycles = 300)),
    "prefer the smaller id of two hits at the same distance, whichever comes first" -> { dut =>
      for (ids <- Seq(Seq(7, 3, 5), Seq(3, 5, 7), Seq(5, 7, 3))) {
        val table = driver(dut)
        table.begin(context = 2, tMax = 100, isShadow = false)
        ids.foreach(id => table.offer(2, table.result(t = 40, id)))
        table.check()
        assert(table.best(2).get.id == 3)
      }
    },
    "ignore a hit at tMax, as the model does" -> { dut =>
      for {
        isShadow <- Seq(false, true)
        tMax     <- Seq(BigInt(100), BigInt(2).pow(TestConfigs.tiny.numbers.gridBits - 1) - 1)
      } {
        val table = driver(dut)
        table.begin(context = 1, tMax, isShadow)
        table.offer(1, table.result(t = tMax, id = 0))
        table.check()
        assert(!table.hasHit(1))
        table.checkModel()
        table.offer(1, table.result(t = tMax - 1, id = 9))
        table.check()
        assert(table.hasHit(1))
      }
    },
    "let a shadow ray pass transmissive triangles, and record them" -> { dut =>
      val table = driver(dut)
      table.begin(context = 1, tMax = 100, isShadow = true)
      table.offer(1, table.result(t = 30, id = 0, isTransmissive = true))
      table.check()
      assert(table.occlusion(1) == Occlusion.transmissive)
      table.offer(1, table.result(t = 60, id = 4))
      table.check()
      assert(table.occlusion(1) == Occlusion.opaque)
    },
    "discard the hit of the previous ray" -> { dut =>
      val table = driver(dut)
      table.begin(context = 0, tMax = 100, isShadow = false)
      table.offer(0, table.result(t = 10, id = 1))
      table.begin(context = 0, tMax = 50, isShadow = false)
      table.check()
      assert(!table.hasHit(0))
      table.offer(0, table.result(t = 20, id = 4))
      table.check()
      assert(table.best(0).get.id == 4)
    }
  )
}

private object HitTableSpec {
  final case class Result(
      isHit:          Boolean,
      t:              BigInt,
      id:             BigInt,
      weights:        Seq[BigInt],
      backSide:       Boolean,
      isTransmissive: Boolean
  )

  final case class Trace(tMax: BigInt, isShadow: Boolean, results: Vector[Result] = Vector.empty) {
    private val within = results.filter(result => result.isHit && result.t < tMax)

    /** Results that end the ray if they are below tMax: of a shadow ray opaque triangles only. */
    val ending: Vector[Result] = results.filter(result => result.isHit && !(isShadow && result.isTransmissive))

    def hits: Vector[Result] = ending.filter(_.t < tMax)

    def occlusion: Occlusion.Type =
      if (hits.nonEmpty) Occlusion.opaque else if (within.nonEmpty) Occlusion.transmissive else Occlusion.none

    def best: Option[Result] = hits.minByOption(hit => (hit.t, hit.id))
  }
}

/** Drives the ports of ray set-up and of the triangle unit, and keeps all results of each ray. */
private class HitTableDriver(dut: HitTable, config: ColonnadeConfig, seed: Int) {
  import HitTableSpec._

  private val contexts = config.array.contexts
  private val farthest = (BigInt(1) << (config.numbers.gridBits - 1)) - 1
  private val random   = new Random(seed)
  private val traces   = Array.fill(contexts)(Option.empty[Trace])

  /** Rays that the table has agreed with. */
  private val checked = Seq.newBuilder[Trace]

  /** Pairs of a tMax in grid steps and what the table's readers get; the model checks them at the end. */
  private val tMaxUnits = Seq.newBuilder[(BigInt, BigInt)]

  dut.io.start.valid.poke(false)
  dut.io.result.valid.poke(false)
  dut.io.outcome.context.valid.poke(true)

  def best(context:      Int): Option[Result] = traces(context).flatMap(_.best)
  def hasHit(context:    Int): Boolean        = traces(context).exists(_.hits.nonEmpty)
  def occlusion(context: Int): Occlusion.Type = traces(context).get.occlusion

  def result(t: BigInt, id: BigInt, isHit: Boolean = true, isTransmissive: Boolean = false): Result = {
    val bits = config.numbers.barycentricBits
    Result(isHit, t, id, Seq.fill(3)(BigInt(bits, random)), random.nextBoolean(), isTransmissive)
  }

  def begin(context: Int, tMax: BigInt, isShadow: Boolean): Unit = {
    pokeStart(context, tMax, isShadow)
    step()
  }

  def offer(context: Int, result: Result): Unit = {
    pokeResult(context, result)
    step()
  }

  /** A start and a result in the same cycle belong to different contexts. */
  def run(cycles: Int): Unit = {
    (0 until contexts).foreach(begin(_, tMax(), random.nextBoolean()))
    for (_ <- 0 until cycles) {
      val begun = Option.when(random.nextInt(8) == 0)(random.nextInt(contexts))
      begun.foreach(pokeStart(_, tMax(), random.nextInt(3) == 0))
      val tested = random.nextInt(contexts)
      if (random.nextInt(4) > 0 && !begun.contains(tested))
        pokeResult(tested, result(distance(tested), random.nextInt(8), random.nextInt(5) > 0, random.nextBoolean()))
      step()
      check()
    }
    checkModel()
    val (asked, found) = tMaxUnits.result().distinct.unzip
    assert(found == Model.answers(config, asked.map(Seq(_)), "limit").map(_.head))
  }

  /** Checks that the model has the closest hits of all rays so far. */
  def checkModel(): Unit = {
    val rays    = checked.result().distinct
    val queries = rays.map { ray =>
      Seq(ray.tMax, BigInt(ray.ending.size)) ++ ray.ending.flatMap(hit => Seq(hit.t, hit.id))
    }
    val closest = rays.map(ray => ray.best.fold(Seq[BigInt](0, ray.tMax, 0))(hit => Seq(1, hit.t, hit.id)))
    assert(Model.answers(config, queries, "closest") == closest)
  }

  /** Checks every ray; the outcome of a context comes one cycle later. */
  def check(): Unit = for ((trace, context) <- traces.zipWithIndex; ray <- trace) {
    // Hits do not shorten a shadow ray
    for (reader <- dut.io.tMax) {
      reader.context.poke(context)
      tMaxUnits += (if (ray.isShadow) ray.tMax else ray.best.fold(ray.tMax)(_.t)) -> reader.units.peekRaw()
    }
    val outcome = dut.io.outcome
    outcome.context.bits.poke(context)
    dut.clock.step()
    outcome.hasHit.expect(ray.hits.nonEmpty, s"context $context, $ray")
    if (ray.isShadow) outcome.occlusion.expect(ray.occlusion)
    checked += ray
    for (hit <- ray.best if !ray.isShadow) {
      assert(outcome.hit.t.peekRaw() == hit.t, s"context $context, $ray")
      assert(outcome.hit.id.peekInt() == hit.id, s"context $context, $ray")
      assert(outcome.hit.weights.map(_.peekRaw()) == hit.weights)
      outcome.hit.backSide.expect(hit.backSide)
    }
  }

  /** Few values, so that ties occur, also with tMax; sometimes the extremes. */
  private def tMax(): BigInt = if (random.nextInt(3) == 0) farthest else random.nextInt(12)

  private def distance(context: Int): BigInt = random.nextInt(6) match {
    case 0 => traces(context).fold(farthest)(_.tMax)
    case 1 => BigInt(config.numbers.gridBits - 1, random)
    case _ => random.nextInt(12)
  }

  private def pokeStart(context: Int, tMax: BigInt, isShadow: Boolean): Unit = {
    dut.io.start.valid.poke(true)
    dut.io.start.bits.context.poke(context)
    dut.io.start.bits.tMax.pokeRaw(tMax)
    traces(context) = Some(Trace(tMax, isShadow))
  }

  private def pokeResult(context: Int, result: Result): Unit = {
    val trace = traces(context).get
    traces(context) = Some(trace.copy(results = trace.results :+ result))
    val bits = dut.io.result.bits
    bits.context.poke(context)
    bits.isHit.poke(result.isHit)
    bits.hit.t.pokeRaw(result.t)
    bits.hit.id.poke(result.id)
    bits.hit.weights.zip(result.weights).foreach { case (port, weight) => port.pokeRaw(weight) }
    bits.hit.backSide.poke(result.backSide)
    bits.isTransmissive.poke(result.isTransmissive)
    dut.io.isShadow.poke(trace.isShadow)
    if (config.units.extraSlices) {
      // The result is compared in the cycle before; a start comes with the result itself
      val starts = dut.io.start.valid.peekBoolean()
      dut.io.start.valid.poke(false)
      dut.clock.step()
      dut.io.start.valid.poke(starts)
    }
    dut.io.result.valid.poke(true)
    dut.io.hasHitNow.expect(traces(context).get.hits.nonEmpty, s"context $context, ${traces(context).get}")
  }

  private def step(): Unit = {
    dut.clock.step()
    dut.io.start.valid.poke(false)
    dut.io.result.valid.poke(false)
  }
}
