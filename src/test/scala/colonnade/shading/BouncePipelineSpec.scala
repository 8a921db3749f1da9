package colonnade.shading

import chiseltest._
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import colonnade.{Always, Model, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.collection.mutable
import scala.util.Random

/** The pipeline finds what [[BounceUnit]] finds, which [[BounceUnitSpec]] compares with the same answers of the model.
  */
class BouncePipelineSpec extends AnyFlatSpec with ChiselScalatestTester {
  import BounceStimulus.poke

  behavior of "BouncePipeline"

  private val configs = Seq(0, 2, 4).map(TestConfigs.formats).map(config =>
    config.copy(units = config.units.copy(pathContexts = 40))
  )

  for (config <- configs)
    it should s"equal the model at ${config.precision}" taggedAs Always.unless(config != configs.head) in
      test(new BouncePipeline(config)).withAnnotations(Simulation.verilator) { unit =>
        val random   = new Random(41)
        val stimulus = new BounceStimulus(config, random)
        unit.clock.setTimeout(0)
        for (stalls <- Seq(0.0, 0.5, 0.9)) {
          val hits =
            Seq.fill(20)(stimulus.surface()) ++ Seq.fill(15)(stimulus.any()) ++ Seq.fill(20)(stimulus.grazing()) ++
              Seq.fill(8)(stimulus.critical()) ++ Seq.fill(8)(stimulus.extreme()) ++
              Seq.fill(4)(stimulus.straight()) ++ Seq.fill(4)(stimulus.withoutNormal())
          // Twice as mirrors, so that these meet restarts and each other
          exchange(
            config,
            unit,
            random.shuffle(hits ++ hits.map(_.copy(isGlass = false))),
            stimulus.offset(),
            random,
            stalls
          )
        }

        // Throughput of mirrors that do not restart
        val mirrors = Seq.fill(100)(stimulus.surface().copy(isGlass = false, isFlat = true))
        val cycles  = exchange(config, unit, mirrors, 100, random, 0).toDouble / mirrors.size
        info(f"$cycles%.2f cycles a mirror")
        assert(cycles <= 3.3)
      }

  /** Compares with the model; returns the cycles. */
  private def exchange(
      config: ColonnadeConfig,
      unit:   BouncePipeline,
      hits:   Seq[BounceCase],
      offset: BigInt,
      random: Random,
      stalls: Double
  ): Int = {
    val answers = Model.answers(config, hits.map(_.words(offset)), "bounce")
    val free    = mutable.Queue.from(0 until config.units.pathContexts)
    val flying  = mutable.Map.empty[Int, Int]
    var sent    = 0
    var poked   = -1
    var ended   = 0
    var cycles  = 0
    var idle    = 0
    var held    = Option.empty[BigInt] // the context of an offer that was not taken
    unit.io.offset.poke(offset)
    while (ended < hits.size) {
      val offers = sent < hits.size && free.nonEmpty && (poked == sent || random.nextDouble() >= stalls)
      unit.io.request.valid.poke(offers)
      if (offers && poked < sent) {
        poke(config, offset)(unit.io.request.bits, hits(sent).copy(context = free.head))
        poked = sent
      }
      val takes  = random.nextDouble() >= stalls
      val result = unit.io.result.bits
      unit.io.result.ready.poke(takes)
      idle += 1
      val offered = Option.when(unit.io.result.valid.peekBoolean())(result.context.peekInt())
      assert(held.forall(offered.contains(_)), "an offer has changed")
      val taken = offered.filter(_ => takes)
      held = if (taken.isEmpty) offered else None
      for (context <- taken.map(_.toInt)) {
        val index = flying.remove(context).getOrElse(fail(s"no bounce of context $context"))
        // A reflection starts at the origin of its request
        val (found, full) = (peek(result), answers(index))
        val expected      = if (full.head == 0) full.patch(1, found.slice(1, 4), 3) else full
        assert(found == expected, s"of ${hits(index)} with the offset $offset in ${config.precision}")
        free.enqueue(context)
        ended += 1
        idle = 0
      }
      if (offers && unit.io.request.ready.peekBoolean()) {
        flying(free.dequeue()) = sent
        sent += 1
        idle = 0
      }
      assert(idle < 2000, s"nothing moves after $ended bounces")
      cycles += 1
      unit.clock.step()
    }
    unit.io.request.valid.poke(false)
    unit.io.busy.expect(false)
    cycles
  }

  private def peek(result: BounceResult): Seq[BigInt] =
    (result.isRefraction.peekInt() +: result.origin.axes.map(_.peekInt())) ++
      (result.dir.axes ++ result.reflection.axes).map(_.peekInt()) :+ result.fresnel.natural.peekInt()
}
