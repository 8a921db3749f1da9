package colonnade.unit

import chisel3._
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.numbers.FixedPorts._
import colonnade.shading.Occlusion
import colonnade.{Model, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** The table knows of each ray what a list of all its results says: the least (t, id) below the ray's limit. */
class HitTableSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "HitTable"

  private def config(contexts: Int, format: ColonnadeConfig): ColonnadeConfig =
    format.copy(array = format.array.copy(contexts = contexts))

  for ((contexts, format) <- Seq((1, 0), (4, 0), (5, 2), (3, 4)))
    it should s"hold the least hit of $contexts contexts, format $format" in {
      val shape = config(contexts, TestConfigs.formats(format))
      test(new HitTable(shape))(dut => new HitTableDriver(dut, shape, seed = contexts).run(cycles = 600))
    }

  it should "prefer the smaller id of two hits at the same distance, whichever comes first" in
    test(new HitTable(TestConfigs.tiny)) { dut =>
      for (ids <- Seq(Seq(7, 3, 5), Seq(3, 5, 7), Seq(5, 7, 3))) {
        val driver = new HitTableDriver(dut, TestConfigs.tiny, seed = 1)
        driver.begin(context = 2, limit = 100, isShadow = false)
        ids.foreach(id => driver.offer(2, driver.result(t = 40, id)))
        driver.check()
        assert(driver.best(2).get.id == 3)
      }
    }

  it should "not let a shadow ray hit at its very limit, the light" in
    test(new HitTable(TestConfigs.tiny)) { dut =>
      val driver = new HitTableDriver(dut, TestConfigs.tiny, seed = 1)
      driver.begin(context = 1, limit = 100, isShadow = true)
      driver.offer(1, driver.result(t = 100, id = 0))
      dut.io.hasHit(1).expect(false)
      driver.offer(1, driver.result(t = 99, id = 9))
      dut.io.hasHit(1).expect(true)
    }

  it should "let a shadow ray pass what is clear, and remember it" in
    test(new HitTable(TestConfigs.tiny)) { dut =>
      val driver = new HitTableDriver(dut, TestConfigs.tiny, seed = 1)
      driver.begin(context = 1, limit = 100, isShadow = true)
      driver.offer(1, driver.result(t = 30, id = 0, isClear = true))
      dut.io.hasHit(1).expect(false)
      dut.io.occlusions(1).expect(Occlusion.transmissive)
      driver.offer(1, driver.result(t = 60, id = 4))
      dut.io.hasHit(1).expect(true)
      dut.io.occlusions(1).expect(Occlusion.opaque)
    }

  it should "forget the hit of the ray before" in
    test(new HitTable(TestConfigs.tiny)) { dut =>
      val driver = new HitTableDriver(dut, TestConfigs.tiny, seed = 1)
      driver.begin(context = 0, limit = 100, isShadow = false)
      driver.offer(0, driver.result(t = 10, id = 1))
      driver.begin(context = 0, limit = 50, isShadow = false)
      dut.io.hasHit(0).expect(false)
      driver.offer(0, driver.result(t = 20, id = 4))
      driver.check()
      assert(driver.best(0).get.id == 4)
    }
}

private object HitTableSpec {
  final case class Result(
      isHit:    Boolean,
      t:        BigInt,
      id:       BigInt,
      weights:  Seq[BigInt],
      backSide: Boolean,
      isClear:  Boolean
  )

  final case class Search(limit: BigInt, isShadow: Boolean, results: Vector[Result] = Vector.empty) {
    private val within = results.filter(result => result.isHit && result.t < limit)

    /** A shadow ray only hits what is opaque. */
    def hits: Vector[Result] = within.filter(hit => !isShadow || !hit.isClear)

    def occlusion: Occlusion.Type =
      if (hits.nonEmpty) Occlusion.opaque else if (within.nonEmpty) Occlusion.transmissive else Occlusion.none

    def best: Option[Result] = hits.minByOption(hit => (hit.t, hit.id))
  }
}

/** Plays ray set-up and the triangle unit, and remembers everything that was ever offered for a ray. */
private class HitTableDriver(dut: HitTable, config: ColonnadeConfig, seed: Int) {
  import HitTableSpec._

  private val contexts = config.array.contexts
  private val farthest = (BigInt(1) << (config.numbers.gridBits - 1)) - 1
  private val random   = new Random(seed)
  private val searches = Array.fill(contexts)(Option.empty[Search])

  /** Pairs of a limit in the grid and what the table made of it, to be asked of the model at the end. */
  private val limits = Seq.newBuilder[(BigInt, BigInt)]

  dut.io.search.valid.poke(false)
  dut.io.result.valid.poke(false)
  dut.io.chosen.valid.poke(true)

  def best(context: Int): Option[Result] = searches(context).flatMap(_.best)

  def result(t: BigInt, id: BigInt, isHit: Boolean = true, isClear: Boolean = false): Result = {
    val bits = config.numbers.barycentricBits
    Result(isHit, t, id, Seq.fill(3)(BigInt(bits, random)), random.nextBoolean(), isClear)
  }

  def begin(context: Int, limit: BigInt, isShadow: Boolean): Unit = {
    pokeSearch(context, limit, isShadow)
    step()
  }

  def offer(context: Int, result: Result): Unit = {
    pokeResult(context, result)
    step()
  }

  /** A search and a result in the same cycle are of two contexts. */
  def run(cycles: Int): Unit = {
    (0 until contexts).foreach(begin(_, limit(), random.nextBoolean()))
    for (_ <- 0 until cycles) {
      val begun = Option.when(random.nextInt(8) == 0)(random.nextInt(contexts))
      begun.foreach(pokeSearch(_, limit(), random.nextInt(3) == 0))
      val tested = random.nextInt(contexts)
      if (random.nextInt(4) > 0 && !begun.contains(tested))
        pokeResult(tested, result(distance(tested), random.nextInt(8), random.nextInt(5) > 0, random.nextBoolean()))
      step()
      check()
    }
    val (asked, found) = limits.result().distinct.unzip
    assert(found == Model.answers(config, asked.map(Seq(_)), "limit").map(_.head))
  }

  /** Looks at every ray; the hit of one of them that is chosen comes a cycle later. */
  def check(): Unit = for ((search, context) <- searches.zipWithIndex; ray <- search) {
    dut.io.hasHit(context).expect(ray.hits.nonEmpty, s"context $context, $ray")
    // What lies in a shadow ray's way does not shorten it
    limits += (if (ray.isShadow) ray.limit else ray.best.fold(ray.limit)(_.t)) -> dut.io.limits(context).peekRaw()
    if (ray.isShadow) dut.io.occlusions(context).expect(ray.occlusion)
    for (hit <- ray.best if !ray.isShadow) {
      dut.io.nearest.context.poke(context)
      assert(dut.io.nearest.t.peekRaw() == hit.t, s"context $context, $ray")
      assert(dut.io.nearest.id.peekInt() == hit.id, s"context $context, $ray")
      dut.io.chosen.bits.poke(context)
      dut.clock.step()
      dut.io.served.poke(context)
      assert(dut.io.hit.t.peekRaw() == hit.t, s"context $context, $ray")
      assert(dut.io.hit.id.peekInt() == hit.id, s"context $context, $ray")
      assert(dut.io.hit.weights.map(_.peekRaw()) == hit.weights)
      dut.io.hit.backSide.expect(hit.backSide)
    }
  }

  /** Few values, so that there are ties, also with the limit; now and then the extremes. */
  private def limit(): BigInt = if (random.nextInt(3) == 0) farthest else random.nextInt(12)

  private def distance(context: Int): BigInt = random.nextInt(6) match {
    case 0 => searches(context).fold(farthest)(_.limit)
    case 1 => BigInt(config.numbers.gridBits - 1, random)
    case _ => random.nextInt(12)
  }

  private def pokeSearch(context: Int, limit: BigInt, isShadow: Boolean): Unit = {
    dut.io.search.valid.poke(true)
    dut.io.search.bits.context.poke(context)
    dut.io.search.bits.limit.pokeRaw(limit)
    searches(context) = Some(Search(limit, isShadow))
  }

  private def pokeResult(context: Int, result: Result): Unit = {
    val search = searches(context).get
    searches(context) = Some(search.copy(results = search.results :+ result))
    val bits = dut.io.result.bits
    dut.io.result.valid.poke(true)
    bits.context.poke(context)
    bits.isHit.poke(result.isHit)
    bits.hit.t.pokeRaw(result.t)
    bits.hit.id.poke(result.id)
    bits.hit.weights.zip(result.weights).foreach { case (port, weight) => port.pokeRaw(weight) }
    bits.hit.backSide.poke(result.backSide)
    bits.isClear.poke(result.isClear)
    dut.io.isShadow.poke(search.isShadow)
    dut.io.hasHitNow.expect(searches(context).get.hits.nonEmpty, s"context $context, ${searches(context).get}")
  }

  private def step(): Unit = {
    dut.clock.step()
    dut.io.search.valid.poke(false)
    dut.io.result.valid.poke(false)
  }
}
