package colonnade.shading

import chisel3._
import chisel3.util.{Decoupled, DecoupledIO, Valid}
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.numbers.FixedPorts._
import colonnade.ray.RayRequest
import colonnade.{Always, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.collection.mutable
import scala.util.Random

/** The unit and the pipeline at the same surfaces, with requests and rays of their own. */
private class ShadowRaysHarness(config: ColonnadeConfig) extends Module {
  private val units = Seq(Module(new ShadowRays(config)).io, Module(new ShadowRaysPipeline(config)).io)

  val lights    = IO(chiselTypeOf(units.head.lights))
  val unitShift = IO(chiselTypeOf(units.head.unitShift))
  val surface   = IO(Flipped(Valid(new LitSurface(config))))
  val requests  = IO(Vec(2, Flipped(Decoupled(new ShadowRequest(config)))))
  val rays      = IO(Vec(2, Decoupled(new RayRequest(config))))
  for (((unit, request), ray) <- units.zip(requests).zip(rays)) {
    unit.lights    := lights
    unit.unitShift := unitShift
    unit.surface   := surface
    unit.req :<>= request
    ray :<>= unit.ray
  }
}

class ShadowRaysPipelineSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "ShadowRaysPipeline"

  private val configs = Seq(TestConfigs.tiny, TestConfigs.withPrecision(16, 16, 32)).map(config =>
    config.copy(array = config.array.copy(contexts = 16))
  ) :+ TestConfigs.withPrecision(64, 64, 64)

  for (config <- configs)
    it should s"make the rays of ShadowRays at ${config.precision} with ${config.array.contexts} contexts" taggedAs Always.unless(
      config == configs(1)
    ) in
      test(new ShadowRaysHarness(config)) { dut =>
        val random                    = new Random(11)
        val numbers                   = config.numbers
        def signed(bits: Int): BigInt = BigInt(bits, random) - (BigInt(1) << (bits - 1))
        val shift                     = random.nextInt(5) + 1
        val bits                      = numbers.macBits.min(numbers.sceneBits - shift)
        dut.unitShift.poke(shift)
        for (light <- dut.lights; axis <- light.position.axes) axis.poke(signed(bits))

        for (stalls <- Seq(0.0, 0.5, 0.5, 0.8)) {
          for (context <- 0 until config.array.contexts) {
            dut.surface.valid.poke(true)
            dut.surface.bits.context.poke(context)
            dut.surface.bits.origin.axes.foreach(_.pokeRaw(signed(numbers.sceneBits)))
            dut.clock.step()
          }
          dut.surface.valid.poke(false)
          val all            = for (c <- 0 until config.array.contexts; l <- 0 until config.frame.lights) yield (c, l)
          val asks           = Seq.fill(4)(random.shuffle(all)).flatten
          val (rays, cycles) = exchange(dut, asks, random, stalls)
          assert(rays.head == rays.last)
          if (stalls == 0) {
            info(f"${cycles.toDouble / asks.size}%.2f cycles a ray")
            assert(cycles * 2 <= asks.size * 3 + 8)
          }
        }
      }

  /** The rays of both, and the cycles of the pipeline. */
  private def exchange(dut: ShadowRaysHarness, asks: Seq[(Int, Int)], random: Random, stalls: Double) = {
    val rays   = Seq.fill(2)(mutable.ArrayBuffer.empty[Seq[BigInt]])
    val sent   = Array(0, 0)
    var cycles = 0
    while (rays.exists(_.size < asks.size)) {
      for ((request, unit) <- dut.requests.zipWithIndex) {
        val offers = sent(unit) < asks.size && random.nextDouble() >= stalls
        request.valid.poke(offers)
        if (offers) {
          request.bits.context.poke(asks(sent(unit))._1)
          request.bits.light.poke(asks(sent(unit))._2)
          if (request.ready.peekBoolean()) sent(unit) += 1
        }
      }
      for ((ray, unit) <- dut.rays.zipWithIndex) {
        val takes = random.nextDouble() >= stalls
        ray.ready.poke(takes)
        if (takes && ray.valid.peekBoolean()) rays(unit) += peek(ray)
      }
      if (rays.last.size < asks.size) cycles += 1
      dut.clock.step()
    }
    dut.requests.foreach(_.valid.poke(false))
    (rays.map(_.toSeq), cycles)
  }

  private def peek(ray: DecoupledIO[RayRequest]): Seq[BigInt] =
    Seq(ray.bits.context.peekInt(), ray.bits.isShadow.peekInt()) ++ ray.bits.origin.axes.map(_.peekRaw()) ++
      ray.bits.dir.axes.map(_.peekInt())
}
