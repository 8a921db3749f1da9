package colonnade.shading

import chisel3._
import chiseltest._
import colonnade.TestParts._
import colonnade.numbers.FixedPorts._
import colonnade.ray.RayRequest
import colonnade.{Always, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** A shadow ray goes from its context's surface to its light. */
class ShadowRaysSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "ShadowRays"

  private val configs = Seq(TestConfigs.tiny, TestConfigs.withPrecision(16, 16, 32)).map(config =>
    config.copy(units = config.units.copy(pathContexts = 16))
  ) :+ TestConfigs.withPrecision(64, 64, 64) :+ TestConfigs.gathering(TestConfigs.tiny)

  for (config <- configs)
    it should s"send rays from remembered surfaces at ${config.precision} with ${config.units.pathContexts} contexts, gather ${config.frame.gather}" taggedAs Always.unless(
      config == configs(1)
    ) in
      test(new ShadowRays(config)) { dut =>
        val random                    = new Random(11)
        val numbers                   = config.numbers
        def signed(bits: Int): BigInt = BigInt(bits, random) - (BigInt(1) << (bits - 1))
        val shift                     = random.nextInt(5) + 1
        val bits                      = numbers.macBits.min(numbers.sceneBits - shift)
        val lights                    = Seq.fill(config.frame.lights)(Seq.fill(3)(signed(bits)))
        dut.io.unitShift.poke(shift)
        for ((port, light) <- dut.io.lights.zip(lights); (axis, value) <- port.position.axes.zip(light))
          axis.poke(value)

        for (stalls <- Seq(0.0, 0.5, 0.5, 0.8)) {
          val surfaces = Seq.fill(config.units.pathContexts)(Seq.fill(3)(signed(numbers.sceneBits)))
          val scatters = surfaces.map(_ => Seq.fill(3)(signed(ScatterStage.componentBits)))
          for ((surface, context) <- surfaces.zipWithIndex) {
            for (port <- dut.io.surface.bits.scatter)
              port.axes.zip(scatters(context)).foreach { case (axis, value) => axis.poke(value) }
            dut.io.surface.valid.poke(true)
            dut.io.surface.bits.context.poke(context)
            dut.io.surface.bits.origin.axes.zip(surface).foreach { case (axis, value) => axis.pokeRaw(value) }
            dut.clock.step()
          }
          dut.io.surface.valid.poke(false)
          // A light beyond the last one stands for the gathered ray
          val last           = if (config.frame.gather) config.frame.lights else config.frame.lights - 1
          val all            = for (c <- 0 until config.units.pathContexts; l <- 0 to last) yield (c, l)
          val asks           = Seq.fill(4)(random.shuffle(all)).flatten
          val (rays, cycles) = exchange(dut, asks, random, stalls)
          assert(rays == asks.map { case (context, light) =>
            val from = surfaces(context)
            if (light == config.frame.lights) Seq[BigInt](context, 0) ++ from ++ scatters(context)
            else Seq[BigInt](context, 1) ++ from ++ lights(light).zip(from).map { case (to, from) =>
              (to << shift) - from
            }
          })
          if (stalls == 0) {
            info(f"${cycles.toDouble / asks.size}%.2f cycles a ray")
            assert(cycles * 2 <= asks.size * 3 + 8)
          }
        }
      }

  /** Rays, and cycles to the last one. */
  private def exchange(dut: ShadowRays, asks: Seq[(Int, Int)], random: Random, stalls: Double) = {
    val request = dut.io.req
    var rays    = Vector.empty[Seq[BigInt]]
    var sent    = 0
    var cycles  = 0
    while (rays.size < asks.size) {
      val offers = sent < asks.size && random.nextDouble() >= stalls
      request.valid.poke(offers)
      if (offers) {
        request.bits.context.poke(asks(sent)._1)
        val light = asks(sent)._2
        request.bits.isGathered.poke(light == dut.io.lights.size)
        request.bits.light.poke(light % dut.io.lights.size)
      }
      val takes = random.nextDouble() >= stalls
      dut.io.ray.ready.poke(takes)
      if (takes && dut.io.ray.valid.peekBoolean()) rays :+= peek(dut.io.ray.bits)
      if (offers && request.ready.peekBoolean()) sent += 1
      if (rays.size < asks.size) cycles += 1
      dut.clock.step()
    }
    request.valid.poke(false)
    (rays, cycles)
  }

  private def peek(ray: RayRequest): Seq[BigInt] = Seq(ray.context.peekInt(), ray.isShadow.peekInt()) ++
    ray.origin.axes.map { axis => axis.raw.asInstanceOf[SInt].peekInt() } ++ ray.dir.axes.map(_.peekInt())
}
