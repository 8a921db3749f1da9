package colonnade.refit

import chisel3.{assert => _, _}
import chiseltest._
import colonnade.{Matrix, OneSimulation, TestConfigs}
import colonnade.axi.{AxiMemory, AxiPins}
import colonnade.config.ColonnadeConfig
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** The unit at pins. */
private class RefitPins(config: ColonnadeConfig, busBytes: Int) extends Module {
  val start    = IO(Input(Bool()))
  val settings = IO(Input(new RefitSettings(config)))
  val result   = IO(Output(new RefitResult(config)))
  val errors   = IO(Output(new RefitErrors))
  val isIdle   = IO(Output(Bool()))
  val pins     = IO(AxiPins.readsAndWrites(RefitReader.idBits, busBytes)).suggestName("m_axi")

  private val unit = Module(new RefitUnit(config, busBytes))
  unit.io.start    := start
  unit.io.settings := settings
  result           := unit.io.result
  errors           := unit.io.errors
  isIdle           := unit.io.isIdle
  Seq("aw" -> unit.io.writes.aw, "w" -> unit.io.writes.w, "ar" -> unit.io.reads.ar).foreach { case (channel, stream) =>
    pins.drive(channel, stream)
  }
  pins.receive("b", unit.io.writes.b)
  pins.receive("r", unit.io.reads.r)
}

class RefitUnitSpec extends AnyFlatSpec with OneSimulation {
  behavior of "RefitUnit"

  private val config = TestConfigs.tiny.copy(columnBvhMemory = TestConfigs.tiny.columnBvhMemory.copy(depth = 1 << 15))

  private class Bench(dut: RefitPins, busBytes: Int, seed: Int, stall: Int, delay: Int) {
    val random = new Random(seed)
    val memory = new AxiMemory(dut.pins, busBytes, random, stall)
    memory.maxDelay = delay
    dut.clock.setTimeout(0)

    /** Runs a refit; returns its cycles. */
    def refit(mesh: BentMesh, change: => Unit = ()): Int = {
      mesh.store(memory)
      for ((name, value) <- mesh.settings) dut.settings.elements(name).asInstanceOf[UInt].poke(value)
      change
      dut.start.poke(true)
      cycle()
      dut.start.poke(false)
      var cycles = 1
      while (!dut.isIdle.peekBoolean()) {
        cycle()
        cycles += 1
        assert(cycles < 1000000, "a refit does not end")
      }
      cycles
    }

    def errors: Set[String] =
      dut.errors.elements.collect { case (name, error: Bool) if error.peekBoolean() => name }.toSet

    def cycle(): Unit = { memory.cycle(); dut.clock.step() }

    def check(mesh: BentMesh): Unit = {
      assert(errors == Set.empty)
      assert(mesh.wrong(memory) == Nil)
      val bounds = dut.result.low.axes ++ dut.result.high.axes
      assert(bounds.map(_.peekInt()) == mesh.bounds && dut.result.flatPairs.peekInt() == mesh.flatPairs)
    }
  }

  for ((bus, tags) <- Seq(4 -> Seq(Matrix), 64 -> Nil)) inOneSimulation(new RefitPins(config, bus), tags: _*)(
    (Seq[(String, RefitPins => Unit)](
      s"write the records of the C through a bus of $bus bytes" -> { dut =>
        val formats = for {
          (cell, seed) <- Seq(0, 500, 2500, 9000).zipWithIndex
          leafRecords  <- Seq(1, 2)
        } yield {
          val bench = new Bench(dut, bus, seed, stall = 50, delay = 60)
          val mesh  = BentMesh(config, bench.random, 8, cell, 7, leafRecords)
          bench.refit(mesh)
          bench.check(mesh)
          mesh.flatPairs > 0
        }
        assert(formats.distinct.size == 2, "flat pairs in some meshes")
      },
      s"end, and write nothing else, whatever the plan of $bus bytes" -> { dut =>
        val bench = new Bench(dut, bus, 5, stall = 20, delay = 10)
        val mesh  = BentMesh(config, bench.random, 8, 100, 0, 1)
        for (round <- 0 until 12) {
          bench.refit(
            mesh,
            bench.memory.store(BentMesh.plan, Seq.fill(4 * mesh.entries)(BigInt(32 - 8 * (round % 3), bench.random)))
          )
          assert(bench.errors == Set("plan"))
          assert(bench.memory.written.forall(byte =>
            byte >= BentMesh.records && byte < BentMesh.records + 32 * mesh.records.size
          ))
          val (ofPlan, ofVertices) = bench.memory.read.partition(_ < BentMesh.vertices)
          assert(ofPlan.forall(byte => byte >= BentMesh.plan && byte < BentMesh.plan + 64 * ((mesh.entries + 3) / 4)))
          assert(ofVertices.forall(_ < BentMesh.vertices + 64 * mesh.lines))
        }
        bench.refit(mesh, dut.settings.vertices.poke(BentMesh.vertices + 16))
        assert(bench.errors == Set("alignment") && bench.memory.written.isEmpty)
        bench.memory.response = address => if (address >= BentMesh.vertices && address < BentMesh.records) 2 else 0
        bench.refit(mesh)
        assert(bench.errors == Set("response"))
        bench.memory.response = _ => 0
        bench.refit(mesh)
        bench.check(mesh)
      }
    ) ++ Option.when(bus == 64)("bend 65,000 triangles in a millisecond at 200 MHz" -> (bends(_: RefitPins)))): _*
  )

  private def bends(dut: RefitPins): Unit = {
    val bench  = new Bench(dut, 64, 1, stall = 0, delay = 0)
    val mesh   = BentMesh(config, bench.random, 64, 100, 0, 1)
    val cycles = bench.refit(mesh)
    bench.check(mesh)
    val bytes = bench.memory.bursts.size * 64 - 32 * mesh.records.size
    info(
      f"${mesh.triangles.toDouble / cycles}%.3f triangles a cycle, ${bytes.toDouble / mesh.triangles}%.1f bytes a triangle"
    )
    assert(mesh.triangles * 200000.0 / cycles >= 65000 && bytes <= 60 * mesh.triangles)
  }
}
