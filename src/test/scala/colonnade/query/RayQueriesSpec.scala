package colonnade.query

import chisel3._
import chisel3.util.Valid
import chiseltest._
import colonnade.TestParts._
import colonnade.axi.AxiMemory
import colonnade.common.Context
import colonnade.config.{ColonnadeConfig, PathConfig, QueriesConfig}
import colonnade.formats.{Bounds, HitRecord}
import colonnade.numbers.FixedPorts._
import colonnade.shading.Occlusion
import colonnade.traversal.TriangleHit
import colonnade.{OneSimulation, Packed}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.collection.mutable
import scala.util.Random

/** What a spec tells of a ray. */
private class RayOutcome(config: PathConfig) extends Bundle {
  val context = Context(config)
  val hasHit  = Bool()
  val hit     = new TriangleHit(config)
  val isClear = Bool()
}

private class RayQueriesHarness(config: ColonnadeConfig) extends MemoryUnit {
  private val queries = Module(new RayQueries(PathConfig(config))).io

  val batch     = IO(chiselTypeOf(queries.batch))
  val sensor    = IO(chiselTypeOf(queries.sensor))
  val placement = IO(Input(UInt(queries.placement.getWidth.W)))
  val bounds    = IO(Input(UInt(queries.bounds.getWidth.W)))
  val runs      = IO(chiselTypeOf(queries.runs))
  val resolved  = IO(chiselTypeOf(queries.resolved))
  val failed    = IO(Output(Bool()))
  val rays      = IO(chiselTypeOf(queries.rays))
  val results   = IO(Flipped(Valid(new RayOutcome(config))))
  val refuses   = IO(Output(Bool()))
  queries.batch     := batch
  queries.sensor    := sensor
  queries.placement := placement.asTypeOf(queries.placement)
  queries.bounds    := bounds.asTypeOf(queries.bounds)
  queries.runs :<>= runs
  rays :<>= queries.rays
  queries.results.valid          := results.valid
  queries.results.bits.context   := results.bits.context
  queries.results.bits.hasHit    := results.bits.hasHit
  queries.results.bits.occlusion := Occlusion.none
  queries.results.bits.hit       := results.bits.hit
  queries.results.bits.isClear.foreach(_ := results.bits.isClear)
  resolved := queries.resolved
  failed   := queries.failed
  refuses  := queries.refuses
  attach(Some(queries.read), Some(queries.write))
}

/** What rays have met, in any order, is in memory in theirs: with a full ring, a slow memory, and runs that fail. */
class RayQueriesSpec extends AnyFlatSpec with OneSimulation with Matchers {
  behavior of "RayQueries"

  private val contexts = 64
  private val config   = RayConfigs.tiny.copy(queries = Some(QueriesConfig(contexts)))

  inOneSimulation(new RayQueriesHarness(config))(
    "give hits of rays"                   -> trace(response = 0, form = 0),
    "give ranges of a fan"                -> trace(response = 1, form = 1),
    "give a bit to each occluded ray"     -> trace(response = 2, form = 0),
    "give ranges of tiles, row by row"    -> trace(response = 1, form = 2),
    "give hits of tiles, row by row"      -> trace(response = 0, form = 2),
    "drop runs that cannot be read"       -> trace(response = 0, form = 1, failures = Some(true)),
    "drop them amid occluded rays"        -> trace(response = 2, form = 1, failures = Some(true)),
    "name runs that cannot be written"    -> trace(response = 1, form = 0, failures = Some(false)),
    "keep contexts whose rays do not end" -> trace(response = 2, form = 2, patience = 400)
  )

  /** @param failures of reads, or of writes
    * @param patience cycles from a ray to its result at most
    */
  private def trace(response: Int, form: Int, failures: Option[Boolean] = None, patience: Int = 60)(
      dut: RayQueriesHarness
  ): Unit = {
    val random   = new Random(10 * response + form)
    val stimulus = new BatchStimulus(config, random)
    val memory   = new AxiMemory(dut.pins, 64, random, stall = 30)
    val isTiled  = form == 2 && response < 2
    val size     = if (response == 0) 16 else 8
    val words    = if (form == 0) 8 else 4 // of a ray in memory

    // Runs of any length, or two rows of tiles
    case class Traced(at: BigInt, hits: BigInt, dir: Seq[BigInt], rays: Range) {
      def hitsOf(index: Int): BigInt = {
        val (column, row) = TestSensor.positionOf(index, isTiled)
        hits + (row * 64 + column) * size
      }
    }
    val counts = Seq.fill(8)(if (form == 2 || random.nextBoolean()) Run.rays else 1 + random.nextInt(Run.rays))
    val batch  = stimulus.aimed(counts.sum, response, form)
    val sensor = TestSensor.of(batch.rays.take(9))
    val runs   = for (((count, first), run) <- counts.zip(counts.scanLeft(0)(_ + _)).zipWithIndex) yield {
      val (column, row) = if (isTiled) (run % 4 * Run.tileColumns, run / 4 * Run.tileRows) else (0, run)
      val offset        = if (isTiled) (row * 64 + column) * size else 0x1000 * run
      val word          = if (response == 2) 8 * random.nextInt(8) else 0
      Traced(
        0x100000 + 0x1000 * run,
        0x400000 + offset + word,
        sensor.sum(sensor.corner, column, row),
        first until first + count
      )
    }
    if (form < 2) for (run <- runs) memory.store(run.at, batch.rays.slice(words * run.rays.head, words * run.rays.end))
    val records = for (run <- runs; (ray, index) <- run.rays.zipWithIndex) yield {
      val (x, y)      = TestSensor.positionOf(index, isTiled)
      lazy val stored = batch.rays.slice(words * ray, words * (ray + 1))
      form match {
        case 0 => stored
        case 1 => batch.shared.take(4) ++ stored
        case _ => batch.shared.take(4) ++ TestSensor.floats(sensor.sum(run.dir, x, y)) :+ batch.shared(4)
      }
    }
    val (scale, base) = (stimulus.placed.scale, stimulus.placed.base)
    val isLocal       = BigInt(if (batch.mode.testBit(11)) 1 else 0)
    val kinds         = RayConfigs.model(config, "ray", records.map((scale ++ base :+ isLocal) ++ _)).map(_.head.toInt)

    // Some runs fail
    val fails   = runs.map(_ => failures.nonEmpty && random.nextInt(3) == 0)
    val failing = runs.zip(fails).collect { case (run, true) =>
      (if (failures.contains(true)) run.at else run.hits) / 64
    }
    memory.response = address => if (failing.contains(address / 64)) 2 else 0

    FloatPorts.poke(dut.batch, batch.mode, batch.shared)
    sensor.poke(dut.sensor)
    dut.placement.poke(stimulus.placed.packed)
    val cube = "xyz".map(axis => s"high.$axis" -> ((BigInt(1) << config.numbers.vertexBits) - 1)).toMap
    dut.bounds.poke(new Packed(new Bounds(config.numbers)).pack(cube))
    dut.clock.setTimeout(0)

    // All legal rays enter the cube: by context, those that are to come
    val toCome = records.indices.filter(kinds(_) == 0).groupBy(_ % contexts).map { case (at, rays) =>
      at -> rays.iterator
    }
    val results = mutable.Map.empty[Int, TestResult]
    val traced  = mutable.ArrayBuffer.empty[(Int, Int)] // rays, due

    var (next, resolved, failed, refused, cycle) = (0, 0, 0, 0, 0)
    while (resolved < runs.size) {
      val offers = next < runs.size && random.nextInt(3) > 0
      dut.runs.valid.poke(offers)
      for (run <- runs.lift(next)) {
        dut.runs.bits.rays.poke(run.at)
        dut.runs.bits.hits.poke(run.hits)
        dut.runs.bits.count.poke(run.rays.size)
        dut.runs.bits.isTile.poke(isTiled)
        run.dir.zip(dut.runs.bits.dir).foreach { case (from, to) => to.poke(from) }
      }
      val due = traced.filter(_._2 <= cycle)
      val end = Option.when(due.nonEmpty)(due(random.nextInt(due.size)))
      dut.results.valid.poke(end.nonEmpty)
      for (each @ (ray, _) <- end) {
        results(ray).poke(dut.results.bits, ray % contexts)
        traced -= each
      }
      val accepts = random.nextInt(3) > 0
      dut.rays.ready.poke(accepts)
      memory.cycle()
      if (accepts && dut.rays.valid.peekBoolean()) {
        val ray = toCome(dut.rays.bits.context.peekInt().toInt).next()
        results(ray) = new TestResult(config, dut.rays.bits.tEntry.peekRaw(), random)
        traced += ((ray, cycle + 1 + random.nextInt(patience)))
      }
      if (dut.refuses.peekBoolean()) refused += 1
      if (dut.failed.peekBoolean()) failed += 1
      resolved += dut.resolved.peekInt().toInt
      if (offers && dut.runs.ready.peekBoolean()) next += 1
      dut.clock.step()
      cycle += 1
      cycle should be < 40000
    }
    dut.runs.valid.poke(false)
    for (_ <- 0 until 50) {
      memory.cycle()
      dut.resolved.expect(0)
      dut.clock.step()
    }
    toCome.values.foreach(_.hasNext shouldBe false)
    refused shouldBe kinds.count(_ == 1)
    failed shouldBe fails.count(identity) +- 1 // two may fail in a cycle
    (failed > 0) shouldBe fails.contains(true)

    // Words of 4 bytes, by their address; a run that could not be read has none
    val floats = RayConfigs.model(
      config,
      "hit",
      records.indices.filter(results.contains).map { ray =>
        scale ++ (records(ray).slice(4, 7).map(_ & 0x7fffffff).max +: results(ray).query)
      }
    )
    val replies                        = records.indices.filter(results.contains).zip(floats).toMap
    def wordsOf(ray: Int): Seq[BigInt] = results.get(ray).filter(_.hasHit).fold(
      Seq(records(ray)(7), if (kinds(ray) == 2) HitRecord.outOfRange else HitRecord.miss, BigInt(0), BigInt(0))
    )(result => Seq(replies(ray).head, result.word) ++ replies(ray).tail)
    val expected = runs.zip(fails).filterNot(_._2 && failures.contains(true)).map(_._1).flatMap { run =>
      if (response == 2) {
        val bits =
          run.rays.zipWithIndex.collect { case (ray, i) if results.get(ray).exists(_.hasHit) => BigInt(1) << i }.sum
        Seq(run.hits -> (bits & 0xffffffffL), run.hits + 4 -> (bits >> 32))
      } else
        for ((ray, index) <- run.rays.zipWithIndex; (word, i) <- wordsOf(ray).take(size / 4).zipWithIndex)
          yield run.hitsOf(index) + 4 * i -> word
    }
    for ((at, word) <- expected) withClue(s"at $at: ")(memory.words(at, 1).head shouldBe word)
    memory.written shouldBe expected.flatMap { case (at, _) => (0 until 4).map(at + _) }.toSet
  }
}

/** What a ray meets. */
private class TestResult(config: ColonnadeConfig, entry: BigInt, random: Random) {
  private val numbers = config.numbers
  val hasHit: Boolean = random.nextInt(4) > 0
  private val t       = BigInt(numbers.gridBits - 1, random)
  private val weights = Seq.fill(3)(BigInt(numbers.weightBits - 2, random) + 1)
  private val id      = BigInt(8, random)
  private val flags   = Seq.fill(2)(random.nextBoolean()) // back side, clear

  /** Of the model, after the length of the ray. */
  def query: Seq[BigInt] = Seq(entry, t) ++ weights

  /** Of the hit, with its flags. */
  def word: BigInt = id + flags.zip(Seq(HitRecord.backSide, HitRecord.clear)).collect { case (true, bit) => bit }.sum

  def poke(port: RayOutcome, context: Int): Unit = {
    port.context.poke(context)
    port.hasHit.poke(hasHit)
    port.hit.t.pokeRaw(t)
    port.hit.id.poke(id)
    port.hit.weights.zip(weights).foreach { case (to, weight) => to.pokeRaw(weight) }
    port.hit.backSide.poke(flags.head)
    port.isClear.poke(flags.last)
  }
}
