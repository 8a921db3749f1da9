package colonnade

import chisel3._
import chiseltest.{ChiselScalatestTester, HasTestName}
import circt.stage.ChiselStage
import org.scalatest.TestSuite
import org.scalatest.exceptions.TestFailedException
import org.scalatest.flatspec.AnyFlatSpec

import java.nio.file.{Files, Path, Paths}

/** Proofs of a module by Yosys and abc (`lab/colonnade_lab/units/proof.py`): for all inputs that meet its assumptions,
  * its assertions hold in the cycles that follow one cycle of reset. A spec is cancelled where Yosys is not installed.
  *
  * A proof also fails if it is empty: nothing is asserted, the assumptions contradict one another, or a `cover` cannot
  * happen. Its files are in `test_run_dir`, in a folder with the test's name.
  */
trait Proofs { this: TestSuite with HasTestName =>

  /** Proves the module in all cycles. */
  def prove(module: => Module): Unit = prove(module, Nil)

  /** Proves the module in the first `cycles` cycles: where a proof of all cycles takes too long. */
  def proveUntil(cycles: Int)(module: => Module): Unit = prove(module, Seq("--cycles", cycles.toString))

  private def prove(module: => Module, options: Seq[String]): Unit = {
    if (!Files.isExecutable(Proofs.python)) cancel("Yosys is not installed: run tools/environment proof")
    Proofs.objection(Proofs.write(module, getTestName), options).foreach(fail(_))
  }
}

object Proofs {
  private val python = Paths.get(".cache/proof-environment/bin/python")

  /** Yosys does not read all of firtool's SystemVerilog. */
  private val firtool = Array(
    "--disable-all-randomization",
    "--lowering-options=disallowLocalVariables,disallowPackedArrays,noAlwaysComb"
  )

  /** Writes a module in a file that is named after it. */
  private def write(module: => Module, folder: String): Path = {
    val text = ChiselStage.emitSystemVerilog(module, firtoolOpts = firtool)
    val top  = raw"(?m)^module (\w+)\(".r.findAllMatchIn(text).map(_.group(1)).toSeq.last
    Files.writeString(Files.createDirectories(Paths.get("test_run_dir", folder)).resolve(s"$top.sv"), text)
  }

  /** What is wrong with a proof; nothing where it holds. */
  private def objection(file: Path, options: Seq[String]): Option[String] = {
    val command = Seq(python.toString, "-m", "colonnade_lab.units.proof", file.toString) ++ options
    val builder = new ProcessBuilder(command: _*).redirectErrorStream(true)
    builder.environment.put("PYTHONPATH", "host:lab")
    val run  = builder.start()
    val text = new String(run.getInputStream.readAllBytes)
    Option.when(run.waitFor() != 0)(text.trim)
  }
}

/** Counts while `counts` is set. */
private class Counter(check: (UInt, Bool) => Unit) extends Module {
  val counts = IO(Input(Bool()))

  private val count = RegInit(0.U(4.W))
  count := count + counts
  check(count, counts)
}

/** A single-port memory of three words; registers keep the first write and its address. */
private class OnePort(readsAlways: Boolean) extends Module {
  val isUsed  = IO(Input(Bool()))
  val isWrite = IO(Input(Bool()))
  val address = IO(Input(UInt(2.W)))
  val data    = IO(Input(UInt(3.W)))

  assume(address < 3.U)
  private val words   = SyncReadMem(3, UInt(3.W))
  private val word    = words.readWrite(address, data, isUsed, isWrite)
  private val written = RegInit(false.B)
  private val place   = Reg(UInt(2.W))
  private val value   = Reg(UInt(3.W))
  private val writes  = isUsed && isWrite
  assume(!(written && writes && address === place))
  when(writes && !written) {
    written := true.B
    place   := address
    value   := data
  }
  private val reads    = written && address === place && !writes && (isUsed || readsAlways.B)
  private val wasAsked = RegNext(reads, false.B)
  assert(!wasAsked || word === value, "the word that was written")
  cover(wasAsked && value === 5.U)
}

class ProofsSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "Proofs"

  private def objection(proof: => Unit): String = intercept[TestFailedException](proof).getMessage

  it should "prove what holds in all cycles, and reach covers" in {
    prove {
      new Counter((count, counts) => {
        chisel3.assume(!(counts && count === 6.U))
        chisel3.assert(count < 7.U)
        cover(count === 6.U)
      })
    }
  }

  it should "prove what holds in some cycles" in {
    val module = () =>
      new Counter((count, _) => {
        chisel3.assert(count < 5.U)
        cover(count === 4.U)
      })
    proveUntil(cycles = 5)(module())
    assert(objection(proveUntil(cycles = 6)(module())).contains("violated in cycle 6"))
    assert(objection(prove(module())).contains("violated in cycle 6"))
  }

  it should "name the first violated assertion, its cycle and its trace" in {
    val text = objection(prove {
      new Counter((count, _) => {
        chisel3.assert(count < 9.U, "less than nine")
        chisel3.assert(count < 4.U, "less than four")
      })
    })
    assert(text.startsWith("Counter: violated in cycle 5 after the reset: 'less than four' (Proofs.scala:"))
    assert(!text.contains("nine"))
    val trace = Paths.get(text.split(" see ").last)
    assert(trace.endsWith("Counter.vcd") && Files.readString(trace).contains(" count "))
  }

  it should "refuse contradictory assumptions" in {
    val text = objection(prove {
      new Counter((count, counts) => {
        chisel3.assume(counts)
        chisel3.assume(count < 2.U)
        chisel3.assert(count < 2.U)
      })
    })
    assert(text.contains("the assumptions cannot be kept for 20 cycles"))
  }

  it should "refuse a proof with an unreachable cover" in {
    val module = () =>
      new Counter((count, counts) => {
        chisel3.assume(!(counts && count === 4.U))
        chisel3.assert(count < 8.U)
        cover(count === 5.U)
      })
    assert(objection(proveUntil(cycles = 5)(module())).contains("cannot happen within 5 cycles: src/test"))
    assert(objection(prove(module())).contains("cannot happen: src/test"))
  }

  it should "refuse a proof without assertions" in {
    assert(objection(prove(new Counter((_, _) => ()))).contains("nothing is asserted"))
  }

  it should "model a single-port memory whose output is undefined without a read" in {
    prove(new OnePort(readsAlways = false))
    assert(objection(prove(new OnePort(readsAlways = true))).contains("the word that was written"))
  }
}
